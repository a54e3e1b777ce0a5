"""fractal-exp: from one image of a self-similar shape to the iterated function system that draws it, at any zoom.

>>> from fractal_exp import View, invert, render                # doctest: +SKIP
>>> found = invert("leaf.png")                                      # doctest: +SKIP
>>> image = render(found.code, View(center=(0.1, -0.3), zoom=64))   # doctest: +SKIP
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

from .runtime import threads

if not threads.QUIET.keys() & os.environ.keys():  # else the user has chosen
    os.environ.update(threads.QUIET)  # acts where this package is imported before torch

from .errors import InputError

if TYPE_CHECKING:
    from .api import invert
    from .ifs import IFS, Colours, View
    from .inversion import Inversion
    from .perceptual.distances import perceptual_distance
    from .rendering.still import render

__all__ = ["IFS", "Colours", "InputError", "Inversion", "View", "invert", "perceptual_distance", "render"]
__version__ = "0.1.0"

# Modules that import torch or more are imported at their first use: a command answers --help before torch is there.
_LATER = {
    "Colours": ".ifs",
    "IFS": ".ifs",
    "Inversion": ".inversion",
    "View": ".ifs",
    "invert": ".api",
    "perceptual_distance": ".perceptual.distances",
    "render": ".rendering.still",
}


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_LATER[name], __name__), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


def complete_codes() -> None:
    """Give codes the methods for their files, dimensions, pictures and pages, whose folders stand on codes. `ifs` asks
    for it when it is loaded."""
    from .dimension import dimension
    from .ifs import IFS, formats
    from .rendering.svg import Svg
    from .viewer import show

    formats.FORMATS[Svg.key] = Svg()
    for name, method in {"save": formats.save, "load": staticmethod(formats.load),
                         "from_json": staticmethod(formats.from_json), "dimension": dimension,
                         "save_html": show.save_html, "widget": show.widget, "_repr_png_": show.picture,
                         "_repr_html_": show.framed_page}.items():
        setattr(IFS, name, method)
