"""The registry of backends that compute the operations, and the choice among them.

The folder of an operation has a module for each backend, with the same functions as `reference`. It is imported at its
first use, so that nobody waits for a compiler that is not needed.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

import torch
from torch import Tensor

from ..errors import InputError
from ..runtime.checks import check_choice
from . import cuda_launch

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Backend:
    """A backend's module, the test for the tensors that it accepts, and a description of them."""

    module: str
    takes: Callable[[Tensor], bool]
    needs: str


BACKENDS: dict[str, Backend] = {  # "auto" takes the first that accepts the tensor
    "cpu": Backend("cpu", lambda t: t.device.type == "cpu" and t.dtype == torch.float32, "float32 tensors on the CPU"),
    "cuda": Backend("cuda", lambda t: (t.device.type == cuda_launch.DEVICE and t.dtype == torch.float32
                                       and cuda_launch.INSTALLED),
                    "float32 tensors on an NVIDIA GPU, and numba-cuda (pip install 'fractal-exp[cuda]')"),
    "torch": Backend("reference", lambda t: t.dtype in (torch.float32, torch.float64), "float32 or float64 tensors"),
}


def check_name(name: str) -> None:
    """Raise `InputError` unless `name` is "auto" or a backend."""
    check_choice("backend", name, ["auto", *BACKENDS])


def choose(name: str, tensor: Tensor) -> str:
    """The name of the backend to use: `name` itself, or for "auto" the first that accepts the tensor.

    Raises `InputError` if there is no such backend or it does not accept the tensor's device and dtype.
    """
    check_name(name)
    candidates = BACKENDS if name == "auto" else [name]
    for candidate in candidates:
        if BACKENDS[candidate].takes(tensor):
            if name == "auto" and candidate == "torch" and tensor.dtype == torch.float32:
                _say_that_it_is_slow(tensor.device.type)
            return candidate
    needs = "; or ".join(f"{BACKENDS[candidate].needs} (backend={candidate!r})" for candidate in candidates)
    raise InputError(f"backend={name!r} needs {needs}, got {tensor.dtype} on {tensor.device}; convert with "
                     f"tensor.to(...) or leave backend='auto'")


@functools.cache
def _say_that_it_is_slow(device: str) -> None:
    log.warning("there are no kernels for tensors on %r here, the operations run as plain torch, which is slow and "
                "takes much memory; an NVIDIA GPU's need numba-cuda (pip install 'fractal-exp[cuda]')", device)


def load(operation: str, name: str) -> ModuleType:
    """The module of a backend for the operation of the package `operation`."""
    return import_module(f"{operation}.{BACKENDS[name].module}")
