"""What the tests of the operations share: one table of tolerances, random codes, collage problems, and a switch of
thread counts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numba
import torch
from torch import Tensor

from fractal_exp.ops.collage import BinnedMeasure, Descent, descend, pushforward

# |got - expected| / |expected| in the Euclidean norm, by the dtype that computed `got`.
TOLERANCE = {torch.float32: 2e-6, torch.float64: 1e-12}


def assert_close(got: Tensor, expected: Tensor, name: str, factor: float = 1.0) -> None:
    """Relative error in norm under the table's tolerance, times `factor` where a test has a reason for it."""
    assert got.shape == expected.shape, f"{name}: shape {tuple(got.shape)} instead of {tuple(expected.shape)}"
    difference = (got.detach().double() - expected.detach().double()).norm()
    error = float(difference / expected.detach().double().norm().clamp(min=1e-20))
    assert error <= factor * TOLERANCE[got.dtype], f"{name}: relative error {error:.2e}"


def tiling_problem(size: int = 32, grids: int = 3, maps: int = 3, samples: int = 500, floor: float = 1e-5
                   ) -> tuple[BinnedMeasure, Tensor, Tensor]:
    """A measure of samples, and maps (4,maps,6) and weights (4,maps) to tile it with; the second set has one less."""
    g = torch.Generator().manual_seed(0)
    mass = torch.rand(samples, 1, generator=g)
    thrown = torch.cat([torch.rand(samples, 2, generator=g) - 0.5, mass / mass.sum()], 1)
    whole = torch.tensor([[[1.0, 0, 0, 1, 0, 0]]])
    bins = pushforward(whole, torch.ones(1, 1), thrown, size)[0]
    sets, weights = torch.randn(4, maps, 6, generator=g) * 0.3, torch.rand(4, maps, generator=g)
    if maps > 1:
        weights[1, -1] = 0
    return BinnedMeasure(thrown, bins, grids, floor), sets, weights / weights.sum(1, keepdim=True)


def check_pushforward(backend: str, device: str = "cpu", **problem: int) -> None:
    """Beside the twin; nothing is lost."""
    measure, maps, weights = tiling_problem(**problem)
    given = maps.to(device), weights.to(device), measure.samples.to(device), measure.size
    ours, twin = (pushforward(*given, backend=b) for b in (backend, "torch"))
    torch.testing.assert_close(ours, twin, atol=1e-6, rtol=1e-5)
    torch.testing.assert_close(ours.sum((1, 2)).cpu(), torch.ones(4))


def check_pushforward_gradients(backend: str, **problem: int) -> None:
    """By maps, weights and samples, beside those of the twin; an absent map has none."""
    measure, maps, weights = tiling_problem(**problem)
    slope = torch.randn(len(maps), measure.size, measure.size, generator=torch.Generator().manual_seed(1))
    found = []
    for each in (backend, "torch"):
        given = [tensor.clone().requires_grad_() for tensor in (maps, weights, measure.samples)]
        bins = pushforward(*given, measure.size, backend=each)
        found.append([*torch.autograd.grad((bins * slope).sum(), given)])
    present = weights > 0
    torch.testing.assert_close(found[0].pop(), found[1].pop(), atol=1e-5, rtol=1e-4)
    for ours, twin in zip(*found, strict=True):
        torch.testing.assert_close(ours[present], twin[present], atol=1e-5, rtol=1e-4)
        assert not bool(ours[~present].any()), "an absent map has a gradient"


def check_descent(backend: str, how: Descent, device: str = "cpu", astray: float = 0, **problem: float) -> None:
    """Beside the twin; a map that is absent does not move. astray: the part of all numbers that may differ, since Adam
    makes a whole step of a slope that is next to nothing."""
    measure, maps, weights = tiling_problem(**problem)
    backgrounds, chosen = torch.stack([0.5 * measure.bins, 0 * measure.bins]), torch.tensor([0, 1, 1, 0])
    measure = BinnedMeasure(measure.samples.to(device), measure.bins.to(device), measure.grids, measure.floor)
    ours, twin = (descend(maps.to(device), weights.to(device), measure, how, backgrounds=backgrounds.to(device),
                          chosen=chosen.to(device), backend=b) for b in (backend, "torch"))
    for a, b in zip(ours[:2], twin[:2], strict=True):
        differing = float((~torch.isclose(a, b, atol=1e-5, rtol=1e-5)).float().mean())
        assert differing <= astray, f"{differing:.3g} of the numbers differ from the twin's, at most {astray} may"
        torch.testing.assert_close(a, b, atol=1e-5 + how.steps * how.rate, rtol=0)
    torch.testing.assert_close(ours[2], twin[2], atol=1e-5, rtol=1e-4 if astray else 1e-5)
    assert len(maps[0]) == 1 or torch.equal(ours[0][1, -1].cpu(), maps[1, -1]), "an absent map moves"


def random_code(*batch: int, maps: int, dtype: torch.dtype = torch.float32, seed: int = 0) -> tuple[Tensor, Tensor]:
    """linear (…,N,2,2) with singular values under 0.9 and offset (…,N,2), both wanting gradients."""
    generator = torch.Generator().manual_seed(seed)
    linear = torch.randn(*batch, maps, 2, 2, generator=generator, dtype=torch.float64)
    scale = 0.3 + 0.6 * torch.rand(*batch, maps, 1, 1, generator=generator, dtype=torch.float64)
    linear = scale * linear / torch.linalg.matrix_norm(linear, ord=2)[..., None, None]
    offset = torch.rand(*batch, maps, 2, generator=generator, dtype=torch.float64) * 2 - 1
    # Rounded to float32 first, so that both dtypes mean the same code.
    return tuple(t.float().to(dtype).requires_grad_() for t in (linear, offset))


@contextmanager
def numba_threads(count: int) -> Iterator[None]:
    before = numba.get_num_threads()
    numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
    try:
        yield
    finally:
        numba.set_num_threads(before)
