"""The measure that a picture shows, as samples and as bins, and its correction by what a code would have shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, avg_pool2d, max_pool2d

from ... import ops
from ...ifs.code import IFS
from ...ops import cuda_launch
from ...ops.collage import BinnedMeasure, orbit_bins, pushforward

SUPERSAMPLE = 16                       # of the pictures that carry a density (Section 5 of the paper)
POINTS_PER_PIXEL = 50_000_000 / 1024**2
THRESHOLD = 0.25                       # of a binary picture
REUSE = 8                              # words under which a point of the invariant measure is put in a drawing
INSIDE = 1 / 64                        # a grey level that counts as lit
TRUST = 4                              # power of the agreement with which a correction is trusted
DENSITY_SHARE = 0.25                   # of inner pixels that are not white, from which on grey levels mean density


@dataclass(frozen=True)
class Levels:
    """What the grey levels of a picture say, shares of `supersample`² subpixels of each pixel: `measure` turns an image
    (R,R) into masses (R,R), `observe` draws a code as such a picture, with its side, a seed, and how often a point may
    be used, `dark` tells from a pixel's grey level and that around it what part of the pixel more mass can still light
    up, `shrunk` makes an image (S,S) of one, as it would have been drawn were it smooth, `nudge_px` is by how far an
    image has to move to be drawn otherwise, and `graded` whether a pixel shows a line thinner than itself."""

    supersample: int
    measure: Callable[[Tensor], Tensor]
    observe: Callable[..., Tensor]
    dark: Callable[[Tensor, Tensor], Tensor]
    shrunk: Callable[[Tensor, int], Tensor]
    nudge_px: float = 0.05
    graded: bool = True


def _poisson_density(image: Tensor) -> Tensor:
    """-log(1 - I): the points a supersampled pixel whose chance to be hit is I."""
    return -(1 - image.clamp(max=1 - 0.5 / SUPERSAMPLE**2)).log()


def _mean(image: Tensor, size: int) -> Tensor:
    return adaptive_avg_pool2d(image[None], size)[0]


def _observer(supersample: int) -> Callable[..., Tensor]:
    def drawn(code: IFS, resolution: int, seed: int, reuse: int = REUSE) -> Tensor:
        from ...rendering.still import render_with_info  # and no warning: candidates may well lie beside the canvas

        device = "cuda" if code.linear.is_cuda and cuda_launch.INSTALLED else "cpu"
        image, _ = render_with_info(code.to("cpu"), resolution=resolution, supersample=supersample, seed=seed,
                                    points_in_view=round(POINTS_PER_PIXEL * resolution**2), reuse=reuse, device=device)
        return image
    return drawn


def _drawn_white(code: IFS, resolution: int, seed: int, reuse: int = 1) -> Tensor:
    # each point once: where all of an image is a little brighter, many pixels pass the threshold together
    return (_observer(SUPERSAMPLE)(code, resolution, seed, reuse) > THRESHOLD).float()


def _shrunk_density(image: Tensor, size: int) -> Tensor:
    return 1 - (-_mean(_poisson_density(image), size)).exp()


def _shrunk_binary(image: Tensor, size: int) -> Tensor:
    covered = _mean(image, size)
    return (covered > (THRESHOLD if bool((covered > THRESHOLD).any()) else 0)).float()


LEVELS = {
    # the chance that a subpixel is hit by a point
    "density": Levels(SUPERSAMPLE, _poisson_density, _observer(SUPERSAMPLE), lambda grey, around: 1 - grey,
                      _shrunk_density),
    # the part of a pixel that is covered, as in an anti-aliased picture: subpixels so large that points fill them
    "coverage": Levels(SUPERSAMPLE // 4, torch.clone, _observer(SUPERSAMPLE // 4), lambda grey, around: 1 - around,
                       _mean),
    # whether a quarter of a pixel is covered
    "binary": Levels(SUPERSAMPLE, torch.clone, _drawn_white, lambda grey, around: 1 - around, _shrunk_binary,
                     nudge_px=0.3, graded=False),
}


def guess_levels(image: Tensor) -> str:
    """"binary" if there are no greys; "density" if many pixels that are lit all around are not white, as in a picture
    drawn by the chaos game; else "coverage", as in an anti-aliased one."""
    if bool(((image == 0) | (image == 1)).all()):
        return "binary"
    inner = -max_pool2d(-image[None, None], 3, 1, 1)[0, 0] > INSIDE
    inner[0] = inner[-1] = inner[:, 0] = inner[:, -1] = False
    if not bool(inner.any()):
        return "density"
    return "density" if float((image[inner] < 0.95).float().mean()) > DENSITY_SHARE else "coverage"


def binned(masses: Tensor, size: int, levels: int = 3) -> BinnedMeasure:
    """The measure of an image's masses (R,R) on a grid of `size` cells a side, its samples the centroids of the lit
    cells of the same grid, or of the pixels where those are larger."""
    resolution = masses.shape[0]
    masses = (masses / masses.sum()).float()
    row = torch.arange(resolution, device=masses.device)
    cells = min(size, resolution)
    cell = row * cells // resolution
    x = ((2 * row + 1) / resolution - 1).expand(resolution, -1)
    index = (cell[:, None] * cells + cell).flatten()
    weight, wx, wy = (torch.zeros(cells * cells, device=masses.device).scatter_add(0, index, values.flatten())
                      for values in (masses, masses * x, -masses * x.T))
    lit = weight > 0
    samples = torch.stack([wx[lit] / weight[lit], wy[lit] / weight[lit], weight[lit]], 1)
    hats = _hats(resolution, size).to(masses.device)
    return BinnedMeasure(samples, hats.T @ masses @ hats, levels)


def _hats(resolution: int, size: int) -> Tensor:
    """The shares (R,G) of a pixel's mass, spread over the pixel, in the bilinear bins of one axis."""
    shares = torch.zeros(resolution, size)
    row = torch.arange(resolution)
    for shift in (-0.25, 0.25):
        u = ((row + 0.5 + shift) * size / resolution - 0.5).clamp(0, size - 1.001)
        low = u.floor().long()
        shares[row, low] += (1 - (u - low)) / 2
        shares[row, low + 1] += (u - low) / 2
    return shares


def halve(bins: Tensor, size: int) -> Tensor:
    """Bins (…,G,G) summed to (…,size,size)."""
    step = bins.shape[-1] // size
    return avg_pool2d(bins.reshape(-1, 1, *bins.shape[-2:]), step).view(*bins.shape[:-2], size, size) * step**2


def attractor_bins(maps: Tensor, weights: Tensor, size: int, *, points: int, seed: int) -> Tensor:
    """The measure (G,G) of the attractor of maps (N,6) played with chances in proportion to weights (N,)."""
    return orbit_bins(maps[None], weights / weights.sum(), size, trajectories=max(1, points // 400), length=430,
                      warmup=30, seed=seed)[0]


def point_bins(points: Tensor, size: int) -> Tensor:
    """The measure (G,G) of points (P,2) of equal mass, in bilinear bins."""
    samples = torch.cat([points, torch.full_like(points[:, :1], 1 / len(points))], 1)
    identity = points.new_tensor([[[1.0, 0, 0, 1, 0, 0]]])
    return pushforward(identity, points.new_ones(1, 1), samples, size)[0]


def desaturated(masses: Tensor, code: IFS, levels: Levels, seed: int) -> Tensor:
    """The masses (R,R) of a picture times `correction`, summing to 1."""
    corrected = masses * correction(masses, code, levels, seed)
    return corrected / corrected.sum()


def correction(masses: Tensor, code: IFS, levels: Levels, seed: int) -> Tensor:
    """Factors (R,R) that undo what the levels of a picture of `code` hide of its measure.

    Grey levels saturate: where the attractor is thinner than a subpixel, -log(1 - I) underestimates its measure, and
    the collage equation sum p_i f_i#mu = mu holds for the estimate no more. A code that is nearly right is drawn as
    the picture was, and the ratio of its known measure to that drawing's estimate, smoothed over 3 × 3 pixels, is
    applied to the picture: only where both show about the same, so that what is wrong in the code does not spoil it.
    """
    resolution = masses.shape[0]
    bins = torch.zeros_like(masses)
    points = ops.chaos_game(code.linear, code.offset, trajectories=4000, length=530, warmup=30,
                            probabilities=code.sampling_probabilities(), seed=seed)
    inside = (points.abs() < 1).all(1)
    column, row = (((points[inside] * points.new_tensor([1, -1]) + 1) * (resolution / 2)).long().clamp(
        0, resolution - 1)).unbind(1)
    bins.view(-1).scatter_add_(0, row * resolution + column, torch.full_like(column, 1 / len(points), dtype=bins.dtype))
    estimate = levels.measure(levels.observe(code, resolution, seed).to(masses))
    if not bool(estimate.any()):  # too thin for a binary picture
        return torch.ones_like(masses)
    usual = 1 / estimate.sum()
    known, shown, seen = (avg_pool2d(image[None, None], 3, 1, 1)[0, 0] for image in (bins, estimate, masses))
    weak = 1e-3
    ratio = torch.where(shown > 1e-9, (known / usual + weak) / (shown + weak), 1)
    trust = (torch.minimum(shown, seen) / torch.maximum(shown, seen).clamp_min(1e-9)) ** TRUST
    return ratio**trust
