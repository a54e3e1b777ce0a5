"""`fractal-view`: a code as a page to fly into. A plain command line, since there is nothing to compose."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import InputError
from .commands import CODE_HELP, FRAMES, ORDER_HELP, command, command_parser, parse_size

MOST_SIDE = 4096  # pixels of a page's picture

DESCRIPTION = """Write a code as a page to fly into: one HTML file that any browser opens, without a network.

The canvas is [-1,1]², x to the right and y up; a code is brought to it first, its longer side from -0.75 to 0.75
(--frame own leaves it where it is). So a view of the page is one of fractal-render.

examples
  fractal-view fern                                          fern.html, the whole fern
  fractal-view leaf.json -o page.html                        a code of yours
  fractal-view heighway_dragon --center 0.1 -0.3 --zoom 64   the page opens there
  fractal-view fern --size 1920x1080                         pictures are saved as large as that, from any window"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-view`. arguments: those of the process if None."""
    parser = command_parser("fractal-view", DESCRIPTION)
    parser.add_argument("code", help=CODE_HELP)
    parser.add_argument("-o", "--output", help="file to write, .html (default: the code's name in this folder)")
    parser.add_argument("--center", type=float, nargs=2, metavar=("X", "Y"), help="middle of the first view")
    parser.add_argument("--zoom", type=float, help="of the first view")
    parser.add_argument("--size", metavar="PIXELS", help="of the picture: a side, or WIDTHxHEIGHT, up to "
                                                         f"{MOST_SIDE} (default: all of the window)")
    parser.add_argument("--frame", choices=FRAMES, default="canvas", help="bring the code to the canvas or not")
    parser.add_argument("--order", metavar="COLUMNS", help=ORDER_HELP)
    command("fractal-view", write, parser, arguments)


def write(options: argparse.Namespace) -> None:
    """Write the page that the command line asks for."""
    from ..ifs.code import View
    from .code_names import read_code

    view = None
    if options.center is not None or options.zoom is not None:
        if options.center is None or options.zoom is None:
            raise InputError("a first view needs both --center X Y and --zoom; leave both out for the whole")
        view = View(tuple(options.center), options.zoom)
    size = None if options.size is None else parse_size(options.size, most=MOST_SIDE)
    code = read_code(options.code, options.frame, options.order)
    path = code.save_html(options.output or _default(options.code), view=view, resolution=size)
    print(f"{path} ({path.stat().st_size // 1000} kB); open it in a browser")


def _default(name: str) -> str:
    """leaf.html for codes/leaf.json, suite-7.html for suite:7."""
    return f"{Path(name).absolute().stem if Path(name).exists() else name.replace(':', '-')}.html"
