"""Codes and where their attractors lie."""

from .code import IFS, View

__all__ = ["IFS", "View"]
