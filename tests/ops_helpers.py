"""What the tests of the operations share: one table of tolerances, random codes, and a switch of thread counts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numba
import torch
from torch import Tensor

# |got - expected| / |expected| in the Euclidean norm, by the dtype that computed `got`.
TOLERANCE = {torch.float32: 2e-6, torch.float64: 1e-12}


def assert_close(got: Tensor, expected: Tensor, name: str, factor: float = 1.0) -> None:
    """Relative error in norm under the table's tolerance, times `factor` where a test has a reason for it."""
    assert got.shape == expected.shape, f"{name}: shape {tuple(got.shape)} instead of {tuple(expected.shape)}"
    difference = (got.detach().double() - expected.detach().double()).norm()
    error = float(difference / expected.detach().double().norm().clamp(min=1e-20))
    assert error <= factor * TOLERANCE[got.dtype], f"{name}: relative error {error:.2e}"


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
