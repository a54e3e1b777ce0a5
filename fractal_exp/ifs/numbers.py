"""Numbers of a code: from whatever a caller or a file gives to float32 tensors, and back to plain lists."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from ..errors import InputError
from ..runtime.checks import check_dense, shown

LARGEST = torch.finfo(torch.float32).max
TOO_LARGE = 2.0**128 - 2.0**103  # what is smaller rounds to a float32; so in json.mjs
MOST_MAPS = 10_000             # of a code that comes as plain data or in a file; nobody drew one with more
MOST_ITEMS = 10 * MOST_MAPS    # of nested lists: a map has seven numbers at most, in three lists


def floats(name: str, value: Any) -> Tensor:
    """A copy of the value as a float32 tensor without a gradient. Raises `InputError`, which calls it `name`, unless it
    is a regular array of finite real numbers."""
    try:
        try:
            given = torch.as_tensor(value)
        except (ValueError, RuntimeError):  # whole numbers of more than 64 bits
            given = torch.as_tensor(value, dtype=torch.float64)
    except (TypeError, ValueError, RuntimeError, OverflowError) as error:
        raise InputError(f"{name} must be a regular array of numbers: {error}") from error
    check_dense(name, given)
    if given.dtype == torch.bool or given.is_complex():
        raise InputError(f"{name} must be real numbers, got {given.dtype}")
    tensor = given.detach().to(torch.float32)
    if not bool(torch.isfinite(tensor).all()):
        raise InputError(f"{name} must be finite, got NaN or infinity")
    return tensor.clone()


def same(one: Tensor | None, other: Tensor | None) -> bool:
    """Whether two tensors have equal values, wherever they lie, or both are None."""
    return one is other if one is None or other is None else torch.equal(one.cpu(), other.cpu())


def exact(tensor: Tensor) -> list[Any]:
    """Nested lists of the shortest decimals that read back as the same float32."""
    values = tensor.cpu().numpy()
    return [exact(row) for row in tensor] if tensor.ndim > 1 else [float(str(v)) for v in values]


def only_keys(data: Mapping[str, Any], allowed: set[str], what: str = "a code") -> None:
    """Raise `InputError` if the data of a file has keys beyond those allowed."""
    unknown = sorted(map(str, set(data) - allowed))
    if unknown:
        raise InputError(f"unknown keys {reprlib.repr(unknown)}; {what} has {sorted(allowed)}, free notes go into "
                         "'meta'")


def only_numbers(name: str, value: Any) -> Any:
    """Plain nested lists, checked to hold nothing but numbers that float32 can hold: no text, no true or false. Raises
    `InputError` on anything else, and on more than a code of 10 000 maps has."""
    rest, items = [value], 0
    while rest:
        item = rest.pop()
        if isinstance(item, list | tuple):
            items += len(item)
            if items > MOST_ITEMS:
                raise InputError(f"{name} must hold at most {MOST_ITEMS} lists and numbers, those of {MOST_MAPS} maps")
            rest.extend(item)
        elif isinstance(item, bool) or not isinstance(item, int | float):
            raise InputError(f"{name} must hold numbers only, got {reprlib.repr(item)}")
        elif not abs(item) < TOO_LARGE:
            raise InputError(f"{name} must hold finite numbers up to {LARGEST:.4g} (float32), got {shown(item)}")
    return value
