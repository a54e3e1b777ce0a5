"""Queue kernels on torch's current stream, without copies, waits, or anything that a CUDA graph cannot record.

With NUMBA_ENABLE_CUDASIM=1 in the environment, numba runs the same kernels slowly as plain Python on CPU tensors. This
is how they are tested without a GPU.
"""

from __future__ import annotations

import functools
import os
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import torch
from torch import Tensor

SIMULATED = os.environ.get("NUMBA_ENABLE_CUDASIM", "0") not in ("", "0")
DEVICE = "cpu" if SIMULATED else "cuda"  # device of the kernels' tensors
INSTALLED = find_spec("numba_cuda") is not None


def launch(kernel: Any, blocks: int, threads: int, first: Tensor, *rest: Tensor | float | tuple[Any, ...],
           shared_bytes: int = 0) -> None:
    """Queue kernel[blocks, threads](first, *rest): contiguous tensors, numbers, and NamedTuples of both."""
    if not blocks:
        return
    arguments = (first, *rest)
    if SIMULATED:
        kernel[blocks, threads, 0, shared_bytes](*_converted(arguments, Tensor.numpy))
        return
    from numba import cuda

    device = first.device
    with torch.cuda.device(device), cuda.gpus[device.index]:
        stream = _stream(torch.cuda.current_stream(device).cuda_stream)
        kernel[blocks, threads, stream, shared_bytes](*_converted(arguments, _device_array))


def blocks_of(count: int, threads: int) -> int:
    """The number of blocks that together have at least `count` threads."""
    return -(-count // threads)


@functools.lru_cache(maxsize=64)
def _stream(handle: int) -> Any:
    """numba's stream for a CUDA handle. It is the same object at every call, so numba can reuse its prepared launch."""
    from numba import cuda

    # Chaos games are few and long, so their grids are small on purpose.
    warnings.filterwarnings("ignore", message=".*Grid size")
    return cuda.external_stream(handle) if handle else cuda.default_stream()


def _converted(arguments: tuple, convert: Callable[[Tensor], Any]) -> list:
    """The arguments with each tensor converted. A NamedTuple stays one, because the kernel reads it by fields."""
    return [type(argument)(*_converted(argument, convert)) if isinstance(argument, tuple)
            else convert(argument.detach()) if isinstance(argument, Tensor) else argument for argument in arguments]


def _device_array(tensor: Tensor) -> Any:
    from numba import cuda

    return cuda.as_cuda_array(tensor, sync=False)
