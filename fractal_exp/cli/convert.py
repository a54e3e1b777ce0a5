"""`fractal-convert`: a code from one format to another. A plain command line, since there is nothing to compose."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import InputError
from ..runtime import threads
from .commands import CODE_HELP, FRAMES, ORDER_HELP, command, command_parser, printable

DESCRIPTION = """Write codes in another format, which the end of the file's name chooses:

  .json           all of a code, every bit (--to lists and --to rows: the two public spellings)
  .csv            a table: a row a,b,c,d,e,f,p for each map
  .ifs            Fractint: several named codes as text
  .flame          flam3 and Apophysis: maps, weights, camera, palette and colours
  .svg            a drawing of the maps over the shape
  .ply            200 000 points in space, at z = 0

Several codes go into one .ifs or .flame file, and a file of several gives it all that can be read. What was read of
another program's file, what was left out and why is told. Codes stay where they are unless --frame canvas brings each
to the canvas [-1,1]², its longer side from -0.75 to 0.75. A .flame file's camera shows the attractor in either case.

examples
  fractal-convert fern fern.flame                            then: env in=fern.flame flam3-render
  fractal-convert plants.ifs:fern fern.json                  one of several codes, by name
  fractal-convert sheep.flame:#2 sheep.svg --frame canvas    the second one
  fractal-convert fern tree maple_leaf plants.ifs            three codes in one file
  fractal-convert sheep.flame sheep.ifs                      a whole collection
  fractal-convert 00042.csv 00042.json --order abecdf        columns in an order that the file does not tell
  fractal-convert leaf.json rows.json --to rows              rows a b c d e f p"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-convert`. arguments: those of the process if None."""
    parser = command_parser("fractal-convert", DESCRIPTION)
    parser.add_argument("codes", nargs="+", metavar="code", help=CODE_HELP)
    parser.add_argument("out", help="file to write")
    parser.add_argument("--to", metavar="FORMAT", help="instead of by the file's name, such as lists or rows")
    parser.add_argument("--frame", choices=FRAMES, default="own", help="bring the codes to the canvas or not")
    parser.add_argument("--order", metavar="COLUMNS", help=ORDER_HELP)
    command("fractal-convert", convert, parser, arguments)


def convert(options: argparse.Namespace) -> None:
    """Write what the command line asks for."""
    from ..ifs import formats
    from .code_names import read_code, read_codes

    threads.use()
    format = formats.of_file(options.out, options.to)  # refused before codes are read
    if len(options.codes) > 1 and not format.several:
        raise InputError(f"a {format.key} file holds one code, got {len(options.codes)}; write a file for each, or "
                         f"all to one that holds several: "
                         f"{', '.join(suffix for suffix, each in formats.suffixes().items() if each.several)}")
    codes = ([code for text in options.codes for code in read_codes(text, options.frame, options.order)]
             if format.several else [read_code(options.codes[0], options.frame, options.order)])
    path = formats.save(codes, Path(options.out), options.to)
    print(printable(f"{path} ({format.key}, {', '.join(f'{len(code)} maps' for code in codes)})"))
