"""Colours of a code from a picture in colour."""

from .drawing import in_colours
from .error import colour_error
from .fitting import fitted

__all__ = ["colour_error", "fitted", "in_colours"]
