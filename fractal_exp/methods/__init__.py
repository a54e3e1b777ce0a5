"""How a code is got from an image: one file per method, one contract (`base.Method`)."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from .base import Method

METHODS = {  # name -> module.function that builds the method with sensible sizes
    "collage": "collage.laptop",
    "chaotic": "chaotic.laptop",
}


def load(name: str) -> Callable[..., Method]:
    """The function that builds the method called `name`, imported when it is asked for."""
    module, function = METHODS[name].split(".")
    return getattr(import_module(f"{__package__}.{module}"), function)
