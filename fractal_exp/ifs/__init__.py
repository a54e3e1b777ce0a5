"""Codes and where their attractors lie."""

from .code import IFS, View
from .colours import Colours

__all__ = ["IFS", "Colours", "View"]
