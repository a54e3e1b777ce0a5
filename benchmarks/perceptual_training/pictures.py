"""Batches to train on: codes, copies of them that are moved by known amounts, and pictures of all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from fractal_exp.rendering.still import points_per_view
from fractal_exp.suite import TARGET_SUPERSAMPLE, draw_code
from fractal_exp.training import drawing
from fractal_exp.training.codes import Maps, rows, similar, table

from .perturbations import KINDS, contractive, displacement, frame, orbits_of_one_address, perturbed

PARTS = 512                     # supersampled pixels a side, at least, of the pictures; from 64² on,
FEWEST_PARTS = 4                # and of each pixel
CLOSER = 0.3                    # the share of codes that are drawn from closer by
SMALLEST, LARGEST = 2e-3, 0.8   # of the perturbations' sizes, spread evenly over their logarithm
MIDDLE = np.zeros(2)            # of the canvas, and of framed codes
FEWEST_IN_VIEW = 64             # of 2048 points: else a view is not taken


@dataclass(frozen=True)
class Path:
    """A code and codes that came near to it during a fit, all of as many maps and in the frame they are drawn in."""

    truth: Maps
    steps: tuple[Maps, ...]


class Pictures(NamedTuple):
    """Pictures of T codes: `truth` and `partner`, another picture of the same code, (T,R,R); `copies` (T,K,R,R) of
    moved codes and their `sizes` (T,K), the root mean square displacement in pixels; `classes` (T,), the code's number.
    """

    truth: Tensor
    partner: Tensor
    copies: Tensor
    sizes: Tensor
    classes: Tensor


def random_code(seed: int) -> Maps:
    """A code of the random suite's distribution, or in one case of four a sparse one: three to six similarities that
    fill less of the plane, as the classic codes do. Framed by the box of its points."""
    rng = np.random.Generator(np.random.PCG64(seed))
    if rng.random() < 0.25:
        count = int(rng.integers(3, 6, endpoint=True))
        angle, ratio = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.2, 0.65, count)
        flip = rng.choice([-1.0, 1.0], count)
        cos, sin = ratio * np.cos(angle), ratio * np.sin(angle)
        maps = np.stack([cos, -sin * flip, sin, cos * flip, *rng.uniform(-1, 1, (2, count))], 1)
    else:
        maps = rows(draw_code(rng, {}))
    maps = contractive(maps)
    return similar(maps, *frame(orbits_of_one_address(maps, [], seed % 2**31)[0]))


def batch(codes: list[Maps], classes: list[int], copies: int, resolution: int, seed: int,
          paths: list[Path] | None = None, fine: bool = False) -> Pictures:
    """Pictures of codes, of `copies` moved copies of each and of a partner; with paths the copies are their steps.

    fine: drawn with the points and the supersampling of `suite.target`, of which others have a fraction.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    drawn: list[Maps] = []
    looks: list[_Look] = []
    sizes = np.empty((len(codes), copies))
    for row, code in enumerate(codes):
        if paths is None:
            moved, own_frame = _moved(code, copies, rng), bool(rng.random() < 0.5)
        else:
            picked = rng.choice(len(paths[row].steps), copies, replace=len(paths[row].steps) < copies)
            moved, own_frame = [paths[row].steps[k] for k in picked], False
        points = orbits_of_one_address(code, moved, int(rng.integers(2**31)))
        if own_frame:
            for k in range(copies):
                placed = frame(points[k + 1])
                moved[k], points[k + 1] = similar(moved[k], *placed), placed[0] * points[k + 1] + placed[1]
        zoom, center = _view(points[0], rng)
        inside = (np.abs(points[0] - center) < 1 / zoom).all(-1)
        sizes[row] = [displacement(points[0][inside], other[inside]) * zoom * resolution / 2 for other in points[1:]]
        partner_zoom, partner_center = (1.0, np.zeros(2)) if zoom > 1 else _view(points[0], rng, furthest=1.5)
        drawn += [similar(each, zoom, -zoom * center) for each in [code, *moved]]
        drawn.append(similar(code, partner_zoom, -partner_zoom * partner_center))
        look = _Look.random(resolution, zoom, rng, fine)
        looks += [look, *(look.jittered(rng) for _ in range(copies)), _Look.random(resolution, partner_zoom, rng, fine)]
    maps, p = table(drawn)
    counts = np.array([look.points for look in looks])
    seeds = rng.integers(2**62, size=len(drawn))
    images = torch.from_numpy(drawing.draw(maps, p, seeds, counts, resolution,
                                           TARGET_SUPERSAMPLE if fine else factor(resolution)))
    images = _styled(images, looks).unflatten(0, (len(codes), copies + 2))
    return Pictures(images[:, 0], images[:, -1], images[:, 1:-1], torch.from_numpy(sizes).float(),
                    torch.tensor(classes))


def factor(resolution: int) -> int:
    """How many parts a pixel has a side."""
    return max(FEWEST_PARTS, round(PARTS / resolution))


def _moved(code: Maps, copies: int, rng: np.random.Generator) -> list[Maps]:
    """Copies perturbed at random, each by an amount and in a way of its own, or all along one direction."""
    if rng.random() < 0.3:  # one direction, as a line of descent has it
        stream, kind = int(rng.integers(2**62)), KINDS[int(rng.integers(len(KINDS)))]
        return [perturbed(code, kind, _size(rng), MIDDLE, np.random.Generator(np.random.PCG64(stream)))
                for _ in range(copies)]
    return [perturbed(code, KINDS[int(rng.integers(len(KINDS)))], _size(rng), MIDDLE, rng)
            for _ in range(copies)]


def _size(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))


def _view(points: np.ndarray, rng: np.random.Generator, furthest: float = 4.0) -> tuple[float, np.ndarray]:
    """Zoom and centre (2,): most often the whole canvas, else a point of the attractor from closer by."""
    if rng.random() >= CLOSER:
        return 1.0, np.zeros(2)
    zoom = float(np.exp(rng.uniform(0, np.log(furthest))))
    center = points[int(rng.integers(len(points)))] * (1 - 1 / zoom)
    enough = (np.abs(points - center) < 1 / zoom).all(-1).sum() >= FEWEST_IN_VIEW
    return (zoom, center) if enough else (1.0, np.zeros(2))


@dataclass(frozen=True)
class _Look:
    """How a picture is drawn: points thrown, a Gaussian blur in pixels, an exponent for the grey levels."""

    points: int
    blur_px: float
    gamma: float

    @classmethod
    def random(cls, resolution: int, zoom: float, rng: np.random.Generator, fine: bool) -> _Look:
        per_part = np.exp(rng.uniform(np.log(0.05), np.log(0.7))) * min(zoom, 2.0)
        blur = rng.uniform(0, 1.2) if rng.random() < 0.6 else 0.0
        gamma = np.exp(rng.uniform(-0.6, 0.4)) if rng.random() < 0.5 else 1.0
        points = points_per_view(resolution) if fine else int(per_part * (resolution * factor(resolution)) ** 2)
        return cls(points, float(blur), float(gamma))

    def jittered(self, rng: np.random.Generator) -> _Look:
        """The same look, or in one case of five one that is slightly off."""
        if rng.random() < 0.8:
            return self
        return _Look(int(self.points * np.exp(rng.uniform(-0.7, 0.7))), max(0.0, self.blur_px + rng.normal(0, 0.15)),
                     self.gamma * float(np.exp(rng.normal(0, 0.1))))


def _styled(images: Tensor, looks: list[_Look]) -> Tensor:
    """Images (B,R,R) blurred and with their grey levels bent, each as its look says."""
    sigma = torch.tensor([look.blur_px for look in looks])[:, None]
    offset = torch.arange(-3, 4)
    taps = torch.where(sigma > 0.05, torch.exp(-0.5 * (offset / sigma.clamp(min=0.05)) ** 2), (offset == 0).float())
    taps = taps / taps.sum(1, keepdim=True)
    padded = torch.nn.functional.pad(images, (3, 3))
    images = reduce(add, (taps[:, k, None, None] * padded[:, :, k:k + images.shape[-1]] for k in range(7)))
    padded = torch.nn.functional.pad(images, (0, 0, 3, 3))
    images = reduce(add, (taps[:, k, None, None] * padded[:, k:k + images.shape[-1]] for k in range(7)))
    gamma = torch.tensor([look.gamma for look in looks])[:, None, None]
    return torch.where(gamma == 1, images, images.clamp(0, 1) ** gamma)
