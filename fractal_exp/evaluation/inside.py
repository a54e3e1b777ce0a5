"""Likeness inside a shape: what F1 of masks does not see, for a slab covers every branch of the tree that it hides."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation, binary_fill_holes, distance_transform_edt, gaussian_filter
from torch import Tensor

from .metrics import check_pair

LIT = 0.25          # grey level above which a pixel belongs to the shape
AROUND_PX = 4       # the inside reaches so far beyond the shape
SIGMA_PX, REACH = 1.5, 3.5  # of the window of SSIM, and where it ends, in sigmas: 11 px, as in `metrics.ssim`
C1, C2 = 0.01**2, 0.03**2   # its constants (Wang et al. 2004)
CLOSED = 16         # gaps of up to a sixteenth of the side belong to the outline of a shape
LEAST_DARK = 0.005  # share of the outline below which there is no dark inside: the teeth of a drawn disc


def ssim_inside(drawn: Tensor, image: Tensor, above: float = LIT, known: Tensor | None = None) -> float:
    """The mean of the SSIM map of two images (R,R) in [0,1] over the pixels within 4 px of the second one's shape; in
    [-1,1].

    The map has a Gaussian window of sigma 1.5 and data range 1, as in `skimage.metrics.structural_similarity`. above:
    the grey level above which a pixel belongs to the shape; an image without any is compared on the whole canvas.
    known (R,R): pixels that count, bool; None: all. Raises `InputError` if the shapes differ.
    """
    check_pair(drawn, image, "R, R")
    a, b = (each.detach().cpu().double().numpy() for each in (drawn, image))

    def mean(values: np.ndarray) -> np.ndarray:
        return gaussian_filter(values, SIGMA_PX, truncate=REACH)

    mean_a, mean_b = mean(a), mean(b)
    variances, covariance = mean(a * a) + mean(b * b) - mean_a**2 - mean_b**2, mean(a * b) - mean_a * mean_b
    alike = (2 * mean_a * mean_b + C1) * (2 * covariance + C2) / ((mean_a**2 + mean_b**2 + C1) * (variances + C2))
    shape = b > above
    inside = np.asarray(distance_transform_edt(~shape)) <= AROUND_PX if shape.any() else np.ones_like(shape)
    inside = inside if known is None else inside & known.cpu().numpy()
    return float(alike[inside].mean())


def f1_dark(drawn: Tensor, image: Tensor, above: float = LIT) -> float | None:
    """F1 within a pixel of what is dark inside the outline of the shape on an image (R,R), in [0,1]; None if there is
    no dark inside, as in a disc.

    The outline is the shape with its holes and gaps of up to a sixteenth of the side, as between the branches of a
    tree. above: the grey level up to which a pixel is dark. Raises `InputError` if the shapes differ.
    """
    check_pair(drawn, image, "R, R")
    other, dark = ((each <= above).cpu().numpy() for each in (drawn, image))
    inside = outline(~dark)
    if (inside & dark).sum() <= LEAST_DARK * inside.sum():
        return None
    # What is dark outside counts as near, so that a shape may lie a pixel off at its edge too.
    near = [np.asarray(binary_dilation(each, np.ones((3, 3))), bool) for each in (other, dark)]
    recall, precision = ((each & inside & by).sum() / max((each & inside).sum(), 1)
                         for each, by in zip((dark, other), near, strict=True))
    return float(2 * precision * recall / max(precision + recall, np.finfo(float).tiny))


def outline(shape: np.ndarray) -> np.ndarray:
    """A mask (R,R) with its holes filled and its gaps closed: by a disc whose radius is a 32nd of the side."""
    radius = len(shape) / CLOSED / 2
    padded = np.pad(shape, int(radius) + 1)
    if not shape.any():
        return shape
    grown = np.asarray(distance_transform_edt(~padded)) <= radius
    closed = np.asarray(distance_transform_edt(grown)) > radius
    inner = slice(int(radius) + 1, -int(radius) - 1)
    return np.asarray(binary_fill_holes(closed[inner, inner] | shape))


def shape_level(image: Tensor) -> float:
    """The grey level above which a pixel of an image (R,R) belongs to the shape: `LIT`, or half of the highest level of
    a faint image."""
    return min(LIT, float(image.max()) / 2)
