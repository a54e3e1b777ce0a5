"""Data that travels with the package: the weights of the perceptual distance `fractal` (docs/perceptual.md), and those
of methods with a network (docs/comparisons.md)."""
