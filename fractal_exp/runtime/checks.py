"""What every function asks of the tensors, numbers and memory that it works with, before it begins."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterable
from numbers import Integral, Real

import torch
from torch import Tensor

from ..errors import InputError, did_you_mean

GIB = 2**30
RESERVE = 0.9  # of a device's memory, which something else needs too


def check_dense(name: str, value: Tensor) -> None:
    """Raise `InputError` unless `value` is a torch tensor that holds its numbers plainly, one beside the other."""
    if not isinstance(value, Tensor):
        raise InputError(f"{name} must be a torch tensor, got {type(value).__name__}; use torch.as_tensor")
    if value.device.type == "meta":
        raise InputError(f"{name} must hold numbers, got a tensor on the meta device, which has none")
    if value.is_quantized:
        raise InputError(f"{name} must not be quantized, got {value.dtype}; use tensor.dequantize()")
    if value.layout != torch.strided:
        raise InputError(f"{name} must be a dense tensor, got the layout {value.layout}; use tensor.to_dense()")


def check_tensor(name: str, value: Tensor) -> None:
    """Raise `InputError` unless `value` is a dense tensor with at least one element."""
    check_dense(name, value)
    if 0 in value.shape:
        raise InputError(f"{name} must not be empty, got shape {tuple(value.shape)}")


def check_alike(name: str, value: Tensor, other_name: str, other: Tensor) -> None:
    """Raise `InputError` unless both tensors have one dtype and lie on one device."""
    if value.dtype != other.dtype or value.device != other.device:
        raise InputError(f"{name} and {other_name} must agree in dtype and device, got {value.dtype} on {value.device} "
                         f"and {other.dtype} on {other.device}; convert one with {name}.to({other_name})")


def check_count(name: str, value: int, least: int = 1, most: int = 2**63 - 1) -> None:
    """Raise `InputError` unless `value` is an integer from `least` to `most`; True and False are no integers here."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise InputError(f"{name} must be an integer of at least {least}, got {shown(value)}")
    if value > most:
        raise InputError(f"{name} must be an integer of at most {most}, got {shown(value)}")


def size_of(resolution: int | tuple[int, int], name: str = "resolution") -> tuple[int, int]:
    """The (height, width) of a picture in pixels; one number is both. Raises `InputError` on anything else."""
    if isinstance(resolution, tuple) and len(resolution) != 2:
        raise InputError(f"{name} must be (height, width) or one number of pixels for both, got {shown(resolution)}")
    height, width = resolution if isinstance(resolution, tuple) else (resolution, resolution)
    for side in (height, width):
        check_count(name, side)
    return int(height), int(width)


def check_number(name: str, value: float, what: str, least: float = -math.inf, most: float = math.inf) -> None:
    """Raise `InputError`, "`name` must be `what`", unless `value` is a finite number from `least` to `most`."""
    try:
        good = isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer beyond the floating-point numbers
        good = False
    if not good or not least <= value <= most:
        raise InputError(f"{name} must be {what}, got {shown(value)}")


def check_choice(name: str, value: str | None, choices: Iterable[str]) -> None:
    """Raise `InputError`, which lists them and tells which one may have been meant, unless `value` is a choice."""
    known = list(choices)
    if value not in known:
        raise InputError(f"{name} must be one of {', '.join(known)}, got {value!r}{did_you_mean(str(value), known)}")


def check_seconds(seconds: float | None) -> None:
    """Raise `InputError` unless a limit of time is a number above 0, or None."""
    good = isinstance(seconds, Real) and not isinstance(seconds, bool) and seconds > 0
    if seconds is not None and not good:
        raise InputError(f"seconds must be above 0 (or none for no limit), got {shown(seconds)}; give a number, "
                         "such as 60 for a minute")


def warn_of_nan(**tensors: Tensor) -> None:
    """Warn the caller's caller of tensors that hold NaN. A GPU is not asked, since that would wait for it."""
    for name, value in tensors.items():
        # NaN makes a sum NaN, so that the slow look at each number is seldom needed.
        if value.device.type == "cpu" and bool(value.sum().isnan()) and bool(value.isnan().any()):
            warnings.warn(f"{name} has NaN: what is made of it is NaN or left out, without a gradient", stacklevel=3)


def check_unit(name: str, image: Tensor, slack: float = 0.0) -> None:
    """Raise `InputError` unless all numbers of an image are finite and in [0,1], or no farther off than `slack`."""
    if not bool(torch.isfinite(image).all()):
        raise InputError(f"{name} holds NaN or infinity")
    low, high = float(image.min()), float(image.max())
    if low < -slack or high > 1 + slack:
        raise InputError(f"{name} must lie in [0, 1], got [{low:.4g}, {high:.4g}]; {into_unit(low, high)}")


def into_unit(low: float, high: float) -> str:
    """How numbers from `low` to `high`, which leave [0,1], are brought there, in words."""
    if -1 <= low < 0 and high <= 1:
        return "of numbers in [-1, 1], take (x + 1) / 2"
    return "subtract its minimum first" if low < 0 else "divide it by its white level, such as 255"


def check_memory(what: str, needed: float, device: torch.device, remedy: str) -> None:
    """Raise `InputError` if `needed` bytes, for `what`, are more than nine tenths of all the memory of the device."""
    there = memory_of(device)
    if needed > RESERVE * there:
        raise InputError(f"{what} would take {_gib(needed)} of memory, and {device.type} has {_gib(there)}; {remedy}")


def memory_of(device: torch.device) -> int:
    """The bytes of memory of a device, free or not; of the machine for a CPU."""
    if device.type == "cuda" and torch.cuda.is_available():
        return torch.cuda.get_device_properties(device).total_memory
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 2**63


def shown(value: object) -> str:
    """A value in one short line of an error message."""
    if isinstance(value, Integral) and not isinstance(value, bool) and abs(int(value)) >= 10**20:
        return "an integer of more than 20 digits"
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else text[:77] + "..."


def _gib(count: float) -> str:
    return f"{count / GIB:.3g} GiB"
