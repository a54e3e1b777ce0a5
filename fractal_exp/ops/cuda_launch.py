"""Kernels queued on torch's current stream: no copy, no wait, and nothing that a CUDA graph could not record.

With NUMBA_ENABLE_CUDASIM=1 in the environment numba runs the same kernels as plain Python on CPU tensors, slowly: that
is how they are checked where there is no GPU.
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
DEVICE = "cpu" if SIMULATED else "cuda"  # where the tensors of the kernels lie
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
    """The number of blocks that have a thread for each of `count`."""
    return -(-count // threads)


@functools.lru_cache(maxsize=64)
def _stream(handle: int) -> Any:
    """numba's stream of a CUDA handle, one and the same for every call, so that numba finds its launch prepared."""
    from numba import cuda

    # Chaos games are long and few: their grids are small on purpose.
    warnings.filterwarnings("ignore", message="Grid size")
    return cuda.external_stream(handle) if handle else cuda.default_stream()


def _converted(arguments: tuple, convert: Callable[[Tensor], Any]) -> list:
    """The arguments with each tensor converted; a NamedTuple stays one, which the kernel reads by its fields."""
    return [type(argument)(*_converted(argument, convert)) if isinstance(argument, tuple)
            else convert(argument.detach()) if isinstance(argument, Tensor) else argument for argument in arguments]


def _device_array(tensor: Tensor) -> Any:
    from numba import cuda

    return cuda.as_cuda_array(tensor, sync=False)
