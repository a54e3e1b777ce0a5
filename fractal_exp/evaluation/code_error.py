"""How far a recovered code is from the true one, map by map, and whether it is that code."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from .. import ops
from ..ifs import attractor
from ..ifs.code import IFS
from ..rendering.still import points_per_view, render_with_info
from ..runtime.checks import check_choice
from .metrics import f1

if TYPE_CHECKING:
    import pandas as pd

FOUND_PX = 1.0           # a map is found if it moves points of the attractor by at most this, on average,
FOUND_PART = 0.1         # and by at most this part of the size of its own image
PROBABILITY_FACTOR = 1.25
CEILING_GAP = 0.01       # an F1 this close to the F1 of the truth against itself is at the ceiling
MATTERS_F1 = 0.995       # a map matters if the picture without it has a lower F1 against the whole
TRAJECTORIES, LENGTH, WARMUP = 2000, 60, 50  # 20 000 points: sizes and displacements to within 1%


@dataclass(frozen=True)
class CodeError:
    """How a recovered code differs from the true one.

    - pairs: (recovered map, true map, mean displacement in pixels of the input) of the best assignment.
    - matters: for each true map, whether the image shows it.
    - missed: true maps that matter and are not found.
    - spurious: recovered maps that change the attractor and are near no true map.
    - improbable: true maps that matter and are found, but with another probability.
    - f1: of the whole view against the truth.
    - ceiling_f1: of the truth against itself, rendered with other points.
    """

    pairs: tuple[tuple[int, int, float], ...]
    matters: tuple[bool, ...]
    missed: tuple[int, ...]
    spurious: tuple[int, ...]
    improbable: tuple[int, ...]
    f1: float
    ceiling_f1: float

    @property
    def exact(self) -> bool:
        """Whether the true code itself is recovered: nothing missed, spurious or improbable, and F1 at the ceiling."""
        return not (self.missed or self.spurious or self.improbable) and at_ceiling(self.f1, self.ceiling_f1)

    @property
    def displacement_px(self) -> float:
        """The mean displacement over the true maps that matter and have a partner; NaN if there is none."""
        moved = [px for _, j, px in self.pairs if self.matters[j]]
        return sum(moved) / len(moved) if moved else float("nan")

    def equivalent(self, scores: pd.DataFrame, ceiling: pd.DataFrame) -> bool:
        """Whether this is another code of the same attractor: not exact, but at the ceiling over all views.

        scores and ceiling: per-view tables (see `evaluate`) of the recovered code and of the truth, both against the
        truth; their mean F1 are compared.
        """
        return not self.exact and at_ceiling(float(scores["f1"].mean()), float(ceiling["f1"].mean()))


def at_ceiling(score: float, ceiling: float) -> bool:
    """Whether an F1 is within .01 of the truth's F1 against itself, rendered with other points."""
    return score >= ceiling - CEILING_GAP


def code_error(recovered: IFS, truth: IFS, *, resolution: int, align: str = "bbox", points_in_view: int | None = None
               ) -> CodeError:
    """Match recovered maps to true ones, measure how far apart they are, and say whether the true code is recovered.

    The truth is brought to the canvas (`attractor.normalize`), and so is the recovered code with align="bbox". With
    align="none" it stays in its own frame, for methods that return a code in the frame of the input. The displacement
    of a pair is the mean over the true attractor of |g_i(x) - f_j(x)|, in pixels of an input of `resolution`. Pairs
    have the lowest possible total displacement (Hungarian algorithm).

    A true map is found if its partner is within `tolerances`. The probability of a found map may differ by a factor of
    1.25. Probabilities are compared as the chaos game uses them, |det| + 0.01 for a code without any. If neither code
    states any, they follow from the maps and are not compared. Maps that coincide share their probability, so their sum
    may be right instead. The F1 of the whole view must be within .01 of the truth's own.

    Another code of the same attractor may be far from the true one in this sense; see `CodeError.equivalent`. Raises
    `InputError` if a code is not contractive.
    """
    check_choice("align", align, ("bbox", "none"))
    truth = attractor.normalize(truth)
    recovered = attractor.normalize(recovered) if align == "bbox" else recovered.check_contractive()
    distances, limits = displacements(recovered, truth, resolution), tolerances(truth, resolution)
    rows, columns = linear_sum_assignment(distances.numpy())
    pairs = tuple((int(i), int(j), float(distances[i, j])) for i, j in zip(rows, columns, strict=True))
    partner = {j: i for i, j, px in pairs if px <= limits[j]}

    points = points_per_view(resolution) if points_in_view is None else points_in_view
    matters = tuple(maps_that_matter(truth, resolution, points))
    missed = tuple(j for j, it_does in enumerate(matters) if it_does and j not in partner)
    near = distances <= limits
    suspects = [i for i in range(len(recovered)) if not near[i].any()]
    shown = maps_that_matter(recovered, resolution, points) if suspects else []
    wrong = _wrong_probabilities(recovered, truth, partner, near, resolution)
    whole, again, result = (_mask(code, seed, resolution, points) for code, seed in
                            ((truth, 0), (truth, 1), (recovered, 1)))
    return CodeError(pairs, matters, missed, tuple(i for i in suspects if shown[i]),
                     tuple(j for j in wrong if matters[j]), float(f1(result, whole)), float(f1(again, whole)))


def _wrong_probabilities(recovered: IFS, truth: IFS, partner: dict[int, int], near: Tensor, resolution: int
                         ) -> list[int]:
    """Found true maps j whose partner has another probability, unless the recovered maps near j together have the same
    as the true maps near j. near: bool (recovered, true)."""
    if recovered.probabilities is None and truth.probabilities is None:
        return []
    q, p = (code.sampling_probabilities().cpu().double() for code in (recovered, truth))
    alike = (displacements(truth, truth, resolution) <= tolerances(truth, resolution)).double()
    return [j for j, i in sorted(partner.items())
            if not (_within_factor(q[i], p[j]) or _within_factor(q @ near[:, j].double(), p @ alike[:, j]))]


def _within_factor(q: Tensor, p: Tensor) -> bool:
    return bool((q <= PROBABILITY_FACTOR * p) & (p <= PROBABILITY_FACTOR * q))


def tolerances(truth: IFS, resolution: int) -> Tensor:
    """The maximum distance of a recovered map from each true one, in pixels, float64 (true maps,).

    It is a tenth of the size of the map's own image, but at most 1 px. The size is the root mean square distance of
    f_j(x) from its mean, with x from the invariant measure. An image smaller than a pixel counts as a pixel.
    """
    image = _images(truth, _points(truth))
    size = (image - image.mean(1, keepdim=True)).square().sum(-1).mean(-1).sqrt() * resolution / 2
    return (FOUND_PART * size.clamp(min=1)).clamp(max=FOUND_PX)


def displacements(recovered: IFS, truth: IFS, resolution: int) -> Tensor:
    """The mean over the truth's attractor of |g_i(x) - f_j(x)| in pixels, float64 (recovered maps, true maps)."""
    x = _points(truth)
    g, f = _images(recovered, x), _images(truth, x)
    return torch.stack([torch.linalg.vector_norm(image - f, dim=-1).mean(-1) for image in g]) * resolution / 2


def _points(code: IFS) -> Tensor:
    """Points (P,2) of the attractor, drawn by the invariant measure, float64."""
    return ops.chaos_game(code.linear.cpu(), code.offset.cpu(), trajectories=TRAJECTORIES, length=LENGTH, warmup=WARMUP,
                          probabilities=code.sampling_probabilities().cpu(), seed=0).double()


def _images(code: IFS, x: Tensor) -> Tensor:
    """The images (N,P,2) of points (P,2) under each map."""
    return torch.einsum("nij,pj->npi", code.linear.cpu().double(), x) + code.offset.cpu().double()[:, None]


def maps_that_matter(code: IFS, resolution: int, points_in_view: int) -> list[bool]:
    """For each map, whether the whole view without it has an F1 below .995 against the view with all maps.

    Two renderings of one code do not agree in every pixel, so the limit is .995 times their F1 against each other.
    """
    if len(code) == 1:
        return [True]
    whole, again = _mask(code, 0, resolution, points_in_view), _mask(code, 1, resolution, points_in_view)
    enough = MATTERS_F1 * float(f1(again, whole))
    return [float(f1(_mask(_without(code, i), 1, resolution, points_in_view), whole)) < enough
            for i in range(len(code))]


def _without(code: IFS, i: int) -> IFS:
    """The code without one map and without colours, with the probabilities of the others in the same proportions."""
    rest = [j for j in range(len(code)) if j != i]
    p = code.probabilities
    if p is not None:
        p = p[rest] / p[rest].sum() if float(p[rest].sum()) > 0 else None
    return replace(code, linear=code.linear[rest], offset=code.offset[rest], probabilities=p, colours=None)


def _mask(code: IFS, seed: int, resolution: int, points_in_view: int) -> Tensor:
    return render_with_info(code, resolution=resolution, points_in_view=points_in_view, seed=seed)[0][None]
