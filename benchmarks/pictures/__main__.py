"""Pictures from elsewhere: textbook fractals, trees, density maps, shapes, the binary suite, tone curves, windows,
paper, plots, FractalDB-1k, and samples of long ago.

    python -m benchmarks.pictures textbook --seconds 30                    all pictures of the set, half a minute each
    python -m benchmarks.pictures textbook --tuning --names 'koch*' '*-jpeg'   some of those for tuning
    python -m benchmarks.pictures shapes --set maps=32 --set moves.root=0  options of `invert`, values as JSON
    python -m benchmarks.pictures density --density-maps FILE.npz          the published maps as well
    python -m benchmarks.pictures fractaldb_dots --fractaldb FOLDER        codes of FractalDB-1k, as that set draws them
    python -m benchmarks.pictures binary --report                          only the tables and sheets of what is there
    python -m benchmarks.pictures tone_curves --set 'levels="tonemapped"'   densities seen through gamma and logarithm
    python -m benchmarks.pictures windows --names 'cut-*'                  parts of shapes, cut off on one or two sides
    python -m benchmarks.pictures binary --from-truth                      what is lost apart from the search
    python -m benchmarks.pictures textbook --judge                         the codes that are there, scored again
    python -m benchmarks.pictures textbook --draw FOLDER                   only the pictures themselves
    python -m benchmarks.pictures paper --read                             only how well the pictures are read
    python -m benchmarks.pictures samples --help                           retina, snowflake and fern by both methods

Each fit runs in one process, its limit counts the seconds of core time, and it is a line of fits.jsonl in --output:
code, scores, seconds, options, commit and machine. What is there already is not fitted again. report.md and sheets of
input, result and difference are written at the end.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from fractal_exp.errors import InputError
from fractal_exp.images.pixels import write_image
from fractal_exp.runtime import threads

from . import density_maps, fitting, fractaldb, readings, report, samples
from .sets import SETS


def main(arguments: Sequence[str] | None = None) -> None:
    given = sys.argv[1:] if arguments is None else list(arguments)
    if given[:1] == ["samples"]:
        samples.main(given[1:])
        return
    args = _parser().parse_args(given)
    for variable, path in ((density_maps.VARIABLE, args.density_maps), (fractaldb.VARIABLE, args.fractaldb)):
        if path:  # workers read it too
            os.environ[variable] = str(path.absolute())
    chosen = SETS[args.set]
    names = _names(args)
    if args.draw:
        args.draw.mkdir(parents=True, exist_ok=True)
        for name in names:
            picture = chosen.picture(name)
            if isinstance(picture, Path):
                shutil.copyfile(picture, args.draw / f"{name}{picture.suffix}")
            else:
                write_image(args.draw / f"{name}.png", picture)
        return
    begun = "_from_truth" if args.from_truth else ""
    folder = args.output or Path(f"benchmarks/results/pictures_{args.set}{begun}")
    if args.read:
        if chosen.seen is None:
            raise SystemExit(f"--read takes a set whose shapes alone are known: "
                             f"{', '.join(name for name, each in SETS.items() if each.seen)}; got {args.set}")
        print(readings.write(args.set, chosen.seen, names, folder))
        return
    if args.judge and (args.names or args.role or args.options):
        raise SystemExit("--judge scores all codes of a folder; leave out --names, --tuning, --reporting and --set")
    if args.judge:
        fitting.judge(args.set, folder)
    elif not args.report:
        setting = fitting.Setting(args.seconds or None, args.clock, _options(args.options), args.from_truth)
        fitting.run(args.set, names, setting, folder, args.workers)
    print(report.write(args.set, folder))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="benchmarks.pictures", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", choices=[*SETS, "samples"])
    parser.add_argument("--names", nargs="+", metavar="PATTERN", help="pictures by name, * for any letters")
    role = parser.add_mutually_exclusive_group()
    role.add_argument("--tuning", dest="role", action="store_const", const="tuning", help="only those for tuning")
    role.add_argument("--reporting", dest="role", action="store_const", const="reporting",
                      help="only those for reporting")
    parser.add_argument("--seconds", type=float, default=30, help="for each fit; 0: no limit")
    parser.add_argument("--clock", choices=fitting.CLOCKS, default="core", help="what the seconds are counted by")
    parser.add_argument("--workers", type=int, default=threads.available())
    parser.add_argument("--set", dest="options", action="append", default=[], metavar="KEY=VALUE",
                        help="an option of invert; a.b=1 for one of a component")
    parser.add_argument("--from-truth", action="store_true", help="begin with the true codes: only camera and maps are "
                                                                  "refined. Pictures without one are left out")
    parser.add_argument("--density-maps", type=Path, metavar="PATH", help=f"or {density_maps.VARIABLE}")
    parser.add_argument("--fractaldb", type=Path, metavar="PATH", help=f"or {fractaldb.VARIABLE}")
    parser.add_argument("--output", type=Path, help="folder (default: benchmarks/results/pictures_SET)")
    parser.add_argument("--judge", action="store_true", help="only score the codes that are there again")
    parser.add_argument("--report", action="store_true", help="only write the tables and the sheets")
    parser.add_argument("--read", action="store_true", help="only read the pictures; no fits")
    parser.add_argument("--draw", type=Path, metavar="FOLDER", help="only draw the pictures")
    return parser


def _names(args: argparse.Namespace) -> list[str]:
    """The pictures that were asked for."""
    try:
        roles = SETS[args.set].roles()
    except InputError as error:
        raise SystemExit(str(error)) from error
    names = [name for name, role in roles.items() if args.role in (None, role)
             and any(fnmatchcase(name, pattern) for pattern in args.names or ["*"])]
    if not names:
        raise SystemExit(f"no picture of {args.set} is called {' or '.join(args.names or ['*'])}; names are such as "
                         f"{', '.join(list(roles)[:4])}")
    return names


def _options(pairs: Sequence[str]) -> dict[str, Any]:
    """maps=4 and moves.root=0 as {"maps": 4, "moves": {"root": 0}}; what is no JSON is text."""
    options: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals:
            raise SystemExit(f"--set takes KEY=VALUE, got {pair!r}")
        *path, last = key.split(".")
        place = options
        for part in path:
            place = place.setdefault(part, {})
        try:
            place[last] = json.loads(text)
        except json.JSONDecodeError:
            place[last] = text
    return options


if __name__ == "__main__":
    main()
