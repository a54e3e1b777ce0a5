"""Codes and where their attractors lie."""

from .. import complete_codes
from .code import IFS, View
from .colours import Colours

__all__ = ["IFS", "Colours", "View"]

complete_codes()
