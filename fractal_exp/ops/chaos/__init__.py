"""The chaos game: points of the attractors of codes, differentiable."""

from __future__ import annotations

import math
import warnings
from numbers import Integral

import torch
from torch import Tensor

from ...errors import InputError
from ...runtime.checks import check_alike, check_count, check_dense, check_memory, check_tensor, shown, warn_of_nan
from .. import backends

MAX_MAPS = 65_536      # a map's index is kept in 16 bits
BYTES_OF_A_POINT = 10  # two coordinates, and the index of the map that produced them


def chaos_game(
    linear: Tensor,                        # (…, N, 2, 2)
    offset: Tensor,                        # (…, N, 2)
    *,
    trajectories: int = 2000,
    length: int = 250,
    warmup: int = 10,
    probabilities: Tensor | None = None,   # (…, N) or (N,)
    seed: int | Tensor = 0,                # int, or int64 (…)
    backend: str = "auto",
) -> Tensor:                               # (…, P, 2)
    """Points (…,P,2) of the attractors of IFS codes by the chaos game (Barnsley 1988; Section 4.1 of the paper).

    linear (…,N,2,2) and offset (…,N,2): codes of N maps, with any batch shape …; probabilities (…,N) or (N,), none for
    uniform ones; seed: an int, or int64 (…). P = trajectories · (length - warmup).

    Every trajectory starts at a uniform point of the canvas [-1,1]² and applies a random map `length` times. Its points
    from `warmup` on are kept, trajectory by trajectory. Gradients reach `linear` and `offset` through all steps,
    including warm-up. `probabilities` get none, and a warning says so if they require one. If a code is not
    contractive, points may run away. They stop at coordinates of ±1e6, where their gradient ends, so that nothing
    overflows. A code with NaN has no points; on a CPU, a warning says so.

    The random numbers of a trajectory depend only on the seed and its index, on every backend and device. With an int,
    all codes share starts and uniform variates (common random numbers). With a tensor, each code has its own seed. The
    `cpu` backend repeats points and gradients bit for bit on any number of threads, and so does `cuda` on GPUs of one
    kind. The `torch` backend repeats only the points. `probabilities` are read on the CPU, which waits for the GPU if
    they are there. A seed that changes in a CUDA graph must be a tensor.

    Raises `InputError` on wrong shapes, dtypes or devices, counts below 1, warmup outside 0 … length - 1,
    probabilities that are negative or do not sum to 1, counts that take more memory than there is, or a backend that
    cannot take the tensors.
    """
    batch, maps = _check_code(linear, offset)
    warn_of_nan(linear=linear, offset=offset)
    for name, value in (("trajectories", trajectories), ("length", length)):
        check_count(name, value)
    if isinstance(warmup, bool) or not isinstance(warmup, Integral) or not 0 <= warmup < length:
        raise InputError(f"warmup must be an integer from 0 to length - 1 = {shown(length - 1)}, got {shown(warmup)}")
    codes = math.prod(batch)
    check_memory(f"a chaos game of {shown(trajectories)} trajectories of {shown(length)} points",
                 codes * trajectories * length * BYTES_OF_A_POINT, linear.device,
                 "lower trajectories or length, or play several games")
    thresholds = cumulative_thresholds(probabilities, batch, maps, linear.device).expand(codes, maps)
    seeds = _seeds(seed, batch, linear.device).expand(codes)
    run = backends.load(__name__, backends.choose(backend, linear)).chaos_game
    points = run(linear.reshape(codes, maps, 2, 2), offset.reshape(codes, maps, 2), thresholds, seeds,
                 trajectories=trajectories, length=length, warmup=warmup)
    return points.view(*batch, trajectories * (length - warmup), 2)


def _check_code(linear: Tensor, offset: Tensor) -> tuple[torch.Size, int]:
    """The batch shape and the number of maps."""
    check_tensor("linear", linear)
    check_tensor("offset", offset)
    if linear.ndim < 3 or linear.shape[-2:] != (2, 2):
        raise InputError(f"linear must have shape (…, N, 2, 2), got {tuple(linear.shape)}")
    if offset.shape != linear.shape[:-1]:
        raise InputError(f"offset must have shape {tuple(linear.shape[:-1])} to go with linear "
                         f"{tuple(linear.shape)}, got {tuple(offset.shape)}")
    check_alike("offset", offset, "linear", linear)
    if linear.shape[-3] > MAX_MAPS:
        raise InputError(f"at most {MAX_MAPS} maps are supported, got {linear.shape[-3]}")
    return linear.shape[:-3], linear.shape[-3]


def cumulative_thresholds(probabilities: Tensor | None, batch: tuple[int, ...], maps: int, device: torch.device
                          ) -> Tensor:
    """The cumulative probabilities in units of 2^-32, int64 (B or 1, N): exact on every device."""
    if probabilities is None:
        return torch.arange(1, maps + 1, device=device)[None] * 2**32 // maps
    check_tensor("probabilities", probabilities)
    if probabilities.shape not in ((maps,), (*batch, maps)):
        raise InputError(f"probabilities must have shape ({maps},), one per map, or {(*batch, maps)}, "
                         f"got {tuple(probabilities.shape)}")
    if not probabilities.dtype.is_floating_point:
        raise InputError(f"probabilities must be floating-point numbers, got {probabilities.dtype}; use tensor.float()")
    if probabilities.requires_grad:
        warnings.warn("probabilities require a gradient and get none here; give probabilities.detach()", stacklevel=3)
    p = probabilities.detach().cpu().double().reshape(-1, maps)
    if not bool((p >= 0).all()):
        raise InputError(f"probabilities must not be negative or NaN, got {float(p.min()):.6g}")
    total = p.sum(-1, keepdim=True)
    if not bool(((total - 1).abs() < 1e-3).all()):
        raise InputError(f"probabilities must sum to 1, got {float(total[(total - 1).abs().argmax()]):.6g}; "
                         f"divide them by their sum")
    cumulative = p.cumsum(-1)
    return (cumulative / cumulative[:, -1:] * 2**32).round().long().to(device)


def _seeds(seed: int | Tensor, batch: torch.Size, device: torch.device) -> Tensor:
    """int64 (B or 1,)."""
    if isinstance(seed, Tensor):
        check_dense("seed", seed)
        if seed.dtype != torch.int64 or seed.shape != batch:
            raise InputError(f"a tensor of seeds must be int64 of the batch's shape {tuple(batch)}, got {seed.dtype} "
                             f"of shape {tuple(seed.shape)}")
        return seed.to(device).reshape(-1)
    if isinstance(seed, bool) or not isinstance(seed, Integral) or not -(2**63) <= seed < 2**63:
        raise InputError(f"seed must be an integer of 64 bits or an int64 tensor with one per code, got {shown(seed)}")
    return torch.full((1,), int(seed), dtype=torch.int64, device=device)
