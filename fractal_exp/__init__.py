"""fractal-exp: from one image of a self-similar shape to the iterated function system that draws it."""

from .errors import InputError
from .ifs import IFS, View

__all__ = ["IFS", "InputError", "View"]
__version__ = "0.1.0"
