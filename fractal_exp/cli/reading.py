"""How a command reads a picture as a target: the same options for all, and one reader."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..images.reading import ReadImage

LEVELS = ("auto", "density", "linear", "dots", "tonemapped", "coverage", "binary")
FRAMES = "fit", "part", "keep"
POLARITIES = {"auto": "auto", "true": True, "false": False}


def add_reading(parser: argparse._ActionsContainer) -> None:
    """Add the options that say how a picture is read."""
    parser.add_argument("--invert", choices=POLARITIES, default="auto", help="true: a black shape on white; false: a "
                                                                             "white one on black; auto: as the border "
                                                                             "tells")
    parser.add_argument("--threshold", type=float, help="make every pixel black or white, at this level in (0,1)")
    parser.add_argument("--crop", type=int, nargs=4, metavar=("LEFT", "TOP", "RIGHT", "BOTTOM"),
                        help="read this part of the picture alone, in pixels from its upper left corner")
    parser.add_argument("--frame", choices=FRAMES, default="fit", help="fit (default): around the shape; part: the "
                                                                       "same, and the shape goes on beyond the sides "
                                                                       "that it reaches; keep: that of a square "
                                                                       "picture")
    parser.add_argument("--levels", choices=LEVELS, default="auto", help="what the grey levels mean (default: as "
                                                                           "they look)")
    parser.add_argument("--as-it-is", action="store_true", help="ignore nothing beside the shape, and keep all levels")


def read_picture(path: str, options: argparse.Namespace) -> ReadImage:
    """A picture at `options.resolution`, read as the options of `add_reading` say. Raises `InputError` if it cannot
    be."""
    from ..images.reading import read_target

    return read_target(path, options.resolution, invert=POLARITIES[options.invert], threshold=options.threshold,
                       clean=not options.as_it_is, crop=options.crop, levels=options.levels,
                       frame=options.frame)
