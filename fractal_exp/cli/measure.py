"""`fractal-measure`: dimensions and lacunarity. A plain command line, since there is nothing to compose."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from .commands import CODE_HELP, ORDER_HELP, command, command_parser, refuse_idle

SIDE, LARGEST = 1024, 50 * 10**6  # pixels a side of the drawing of a code; of a picture, for the memory

DESCRIPTION = """Read numbers off codes and pictures: fractal dimensions with their intervals, and lacunarity.

Of a code: the similarity or affinity dimension of its attractor, the information and correlation dimension of its
measure, and what is counted on a drawing of 1024². Of a picture: the box dimension and lacunarity of the shape on it.
A number is exact, an upper bound, or an estimate with an interval of about 95% (docs/dimension.md).

examples
  fractal-measure koch_curve                         a classic
  fractal-measure plants.ifs:fern leaf.png           a code of several, and a picture
  fractal-measure coast.png --threshold 0.5          all pixels of at least half of white
  fractal-measure *.png --json > dimensions.jsonl    a line of JSON for each"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-measure`. arguments: those of the process if None."""
    parser = command_parser("fractal-measure", DESCRIPTION)
    parser.add_argument("measured", nargs="+", metavar="picture-or-code", help=f"a file of a picture, or {CODE_HELP}")
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each, with all digits")
    parser.add_argument("--threshold", type=float, help="of pictures: the least level in (0,1), white on black, that "
                                                        "counts (default: what is seen on the background)")
    parser.add_argument("--invert", choices=("auto", "true", "false"),
                        help="of pictures: whether the shape is black on white (default: auto)")
    parser.add_argument("--order", metavar="COLUMNS", help=ORDER_HELP)
    command("fractal-measure", measure, parser, arguments)


def measure(options: argparse.Namespace) -> None:
    """Print what the command line asks for."""
    from ..dimension.samples import count_boxes, lacunarity
    from ..ifs import attractor
    from ..ifs.contraction import AVERAGE
    from ..images.reading import read_lit
    from ..rendering.still import render
    from ..runtime import threads
    from .code_names import is_picture, read_code

    threads.use()
    pictures = {name for name in options.measured if is_picture(Path(name))}
    if not pictures:
        refuse_idle(options, dict.fromkeys(("threshold", "invert"), "is for pictures, and none is given"))
    elif len(pictures) == len(options.measured):
        refuse_idle(options, {"order": "is for files of codes, and none is given"})
    for name in options.measured:
        if name in pictures:
            lit = read_lit(name, invert={"true": True, "false": False}.get(options.invert, "auto"),
                           threshold=options.threshold, most_pixels=LARGEST)
            of, dimensions = f"{lit.shape[1]}×{lit.shape[0]} px", []
        else:
            code = read_code(name, order=options.order)
            lit = render(attractor.normalize(code), resolution=SIDE, supersample=1).numpy() > 0
            of = f"{len(code)} maps"
            kinds = *([] if code.contraction.kind == AVERAGE else [None]), "information", "correlation"
            dimensions = [code.dimension(kind) for kind in kinds]
        dimensions, gaps = [*dimensions, count_boxes(lit)], lacunarity(lit)
        if options.json:
            print(json.dumps({"name": name, "of": of, "dimensions": list(map(asdict, dimensions)), "lacunarity": gaps}))
            continue
        print(f"{name}: {of}")
        for each in dimensions:
            print(f"  {each.kind:12} {each!s:32} {each.condition}")
        some = [*gaps.items()][::max(1, len(gaps) // 3)]
        print(f"  {'lacunarity':12} {', '.join(f'{value:.3g} at {size} px' for size, value in some)}")
