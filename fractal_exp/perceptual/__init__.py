"""Perceptual distances of images: LPIPS, and `fractal`, which is this package's own."""
