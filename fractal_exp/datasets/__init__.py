"""Data sets of many pictures for pre-training: drawn while they are used, or written to files."""

from .fractals import Fractals
from .writing import write

__all__ = ["Fractals", "write"]
