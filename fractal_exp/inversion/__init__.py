"""From a target and a method to a result: the one road that the library, every command and the local page take."""

from .result import Inversion
from .road import Work, coloured, conclude, reconstruct, run
from .writing import write

__all__ = ["Inversion", "Work", "coloured", "conclude", "reconstruct", "run", "write"]
