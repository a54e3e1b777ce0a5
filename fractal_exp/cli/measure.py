"""`fractal-measure`: dimensions and lacunarity. A plain command line, since there is nothing to compose."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .commands import CODE_HELP, command, command_parser

SIDE = 1024                # pixels of the drawing of a code
LARGEST_PIXELS = 50 * 10**6  # of a picture, for the memory
POLARITIES = {"auto": "auto", "true": True, "false": False}

DESCRIPTION = """Read numbers off codes and pictures: fractal dimensions with their intervals, and lacunarity.

Of a code: the similarity or affinity dimension of its attractor, the information and correlation dimension of its
measure (docs/dimension.md), and box dimension and lacunarity of a drawing at 1024². Each is exact, an upper bound, or
an estimate with an interval of about 95%. Of a picture: box dimension and lacunarity of the shape on it.

examples
  fractal-measure koch_curve                         a classic
  fractal-measure plants.ifs:fern leaf.png           a code of several, and a picture
  fractal-measure coast.png --threshold 0.5          all pixels of at least half of white
  fractal-measure *.png --json > dimensions.jsonl    a line of JSON for each"""


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = command_parser("fractal-measure", DESCRIPTION)
    parser.add_argument("measured", nargs="+", metavar="picture-or-code", help=f"a file of a picture, or {CODE_HELP}")
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each, with all digits")
    picture = parser.add_argument_group("pictures")
    picture.add_argument("--threshold", type=float, help="the least level in (0,1), white on black, that counts as the "
                                                         "shape (default: all that is seen on the background)")
    picture.add_argument("--invert", choices=POLARITIES, default="auto", help="true: a black shape on white; auto: as "
                                                                              "the border tells")
    picture.add_argument("--crop", type=int, nargs=4, metavar=("LEFT", "TOP", "RIGHT", "BOTTOM"),
                         help="the part to measure, in pixels from the upper left corner")
    command("fractal-measure", measure, parser, arguments)


def measure(options: argparse.Namespace) -> None:
    """Print what the command line asks for."""
    from ..runtime import threads

    threads.use()
    for name in options.measured:
        found = measured(name, options)
        print(json.dumps(found) if options.json else _table(found))


def measured(name: str, options: argparse.Namespace) -> dict[str, Any]:
    """The numbers of a code or a picture, as JSON data. Raises `InputError` if it is neither."""
    from ..dimension.samples import count_boxes, lacunarity
    from ..ifs import attractor
    from ..images.reading import read_lit
    from ..rendering.still import render
    from .code_names import is_picture, read_code

    dimensions, code = [], None if is_picture(Path(name)) else read_code(name)
    if code is None:
        lit = read_lit(name, invert=POLARITIES[options.invert], threshold=options.threshold, crop=options.crop,
                       most_pixels=LARGEST_PIXELS)
    else:
        dimensions = [code.dimension(kind) for kind in (None, "information", "correlation")]
        lit = render(attractor.normalize(code), resolution=SIDE, supersample=1).numpy() > 0
    return {"name": name, "maps": code and len(code), "size": list(lit.shape[::-1]),
            "dimensions": [asdict(each) for each in (*dimensions, count_boxes(lit))],
            "lacunarity": lacunarity(lit)}


def _table(found: dict[str, Any]) -> str:
    from ..dimension import Dimension

    of = f"{found['maps']} maps" if found["maps"] else "{}×{} px".format(*found["size"])
    lines = [(each["kind"], str(Dimension(**each)), each["condition"]) for each in found["dimensions"]]
    some = list(found["lacunarity"].items())
    shown = ", ".join(f"{value:.3g} at {size} px" for size, value in (some[0], some[len(some) // 2], some[-1]))
    return "\n".join([f"{found['name']}: {of}", *(f"  {kind:12} {number:32} {why}" for kind, number, why in lines),
                      f"  {'lacunarity':12} {shown}"])
