"""How far a recovered code is from the true one, map by map."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from .. import attractor, ops
from ..errors import InputError
from ..ifs import IFS
from .metrics import f1
from .render import points_per_view, render_with_info

EXACT_PX = 1.0           # a map is found if it moves points of the attractor by at most this, on average
MATTERS_F1 = 0.995       # and it matters if the picture without it agrees less with the whole than this
TRAJECTORIES, LENGTH, WARMUP = 200, 60, 50


@dataclass(frozen=True)
class CodeError:
    """`pairs`: (recovered map, true map, mean displacement in pixels of the input) of the best assignment; `missed`:
    true maps that matter and have no recovered map within 1 px; `spurious`: recovered maps that change their attractor
    and are within 1 px of no true map; `matters`: for each true map, whether the picture shows it."""

    pairs: tuple[tuple[int, int, float], ...]
    missed: tuple[int, ...]
    spurious: tuple[int, ...]
    matters: tuple[bool, ...]

    @property
    def exact(self) -> bool:
        """Whether the code is recovered: nothing that matters is missed, and nothing is spurious."""
        return not self.missed and not self.spurious

    @property
    def displacement_px(self) -> float:
        """The mean displacement over the true maps that matter and have a partner; NaN if there is none."""
        moved = [px for _, j, px in self.pairs if self.matters[j]]
        return sum(moved) / len(moved) if moved else float("nan")


def code_error(recovered: IFS, truth: IFS, *, resolution: int, align: str = "bbox", points_in_view: int | None = None
               ) -> CodeError:
    """Match recovered maps to true ones and measure how far apart they are.

    The truth is taken in the frame of the input (`attractor.normalize`), the recovered code likewise (align="bbox") or
    in its own frame (align="none", for methods that return a code in the input's frame). The displacement of a pair is
    the mean over the true attractor of |g_i(x) - f_j(x)|, in pixels of an input of `resolution`; the pairs are those
    of least total displacement (Hungarian algorithm). Another code of the same attractor (by a symmetry, say) is far
    from the true one in this measure. Raises `InputError` if a code is not contractive.
    """
    from scipy.optimize import linear_sum_assignment

    if align not in ("bbox", "none"):
        raise InputError(f"align must be bbox or none, got {align!r}")
    truth = attractor.normalize(truth)
    recovered = attractor.normalize(recovered) if align == "bbox" else recovered.check_contractive()
    distances = displacements(recovered, truth, resolution)
    rows, columns = linear_sum_assignment(distances.numpy())
    pairs = tuple((int(i), int(j), float(distances[i, j])) for i, j in zip(rows, columns, strict=True))

    points = points_per_view(resolution) if points_in_view is None else points_in_view
    matters = tuple(maps_that_matter(truth, resolution, points))
    found = {(i, j) for i, j, px in pairs if px <= EXACT_PX}
    missed = tuple(j for j, it_does in enumerate(matters) if it_does and j not in {j for _, j in found})
    suspects = set(range(len(recovered))) - {i for i, _ in found}
    shown = maps_that_matter(recovered, resolution, points) if suspects else []
    return CodeError(pairs, missed, tuple(i for i in sorted(suspects) if shown[i]), matters)


def displacements(recovered: IFS, truth: IFS, resolution: int) -> Tensor:
    """The mean over the truth's attractor of |g_i(x) - f_j(x)| in pixels, float64 (recovered maps, true maps)."""
    x = ops.chaos_game(truth.linear.cpu(), truth.offset.cpu(), trajectories=TRAJECTORIES, length=LENGTH, warmup=WARMUP,
                       probabilities=truth.sampling_probabilities().cpu(), seed=0).double()
    g, f = (torch.einsum("nij,pj->npi", code.linear.cpu().double(), x) + code.offset.cpu().double()[:, None]
            for code in (recovered, truth))
    return torch.stack([torch.linalg.vector_norm(image - f, dim=-1).mean(-1) for image in g]) * resolution / 2


def maps_that_matter(code: IFS, resolution: int, points_in_view: int) -> list[bool]:
    """For each map, whether the whole view without it has an F1 below .995 against the view with all maps.

    Two renderings of one code do not agree to the last pixel, so .995 is taken of what they agree by themselves.
    """
    if len(code) == 1:
        return [True]
    whole, again = _mask(code, 0, resolution, points_in_view), _mask(code, 1, resolution, points_in_view)
    enough = MATTERS_F1 * float(f1(again, whole))
    return [float(f1(_mask(_without(code, i), 1, resolution, points_in_view), whole)) < enough
            for i in range(len(code))]


def _without(code: IFS, i: int) -> IFS:
    """The code without one map, the probabilities of the others in proportion."""
    rest = [j for j in range(len(code)) if j != i]
    p = code.probabilities
    if p is not None:
        p = p[rest] / p[rest].sum() if float(p[rest].sum()) > 0 else None
    return replace(code, linear=code.linear[rest], offset=code.offset[rest], probabilities=p)


def _mask(code: IFS, seed: int, resolution: int, points_in_view: int) -> Tensor:
    return render_with_info(code, resolution=resolution, points_in_view=points_in_view, seed=seed)[0][None]
