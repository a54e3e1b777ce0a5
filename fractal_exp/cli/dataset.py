"""`fractal-dataset`: many pictures of codes, for pre-training. A plain command line, since there is nothing to
compose."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .commands import ORDER_HELP, command, command_parser

if TYPE_CHECKING:
    from ..ifs.code import IFS

SEED = 2025  # of the random suite

DESCRIPTION = """Write a data set of many pictures of codes, for the pre-training of networks, on all cores.

  FOLDER/00012-fern/0345.png     a folder for each code, or with --shards
  FOLDER/pictures-000007.tar     WebDataset shards, in random order: INDEX.png and INDEX.cls, the number of the code
  FOLDER/dataset.json            how they were made, and the names of the codes

A code has 1000 pictures, as in FractalDB: 25 ways of jitter, each drawn ten times, each drawing in four flips. The same
command goes on where it was interrupted, and leaves the same bytes.

examples
  fractal-dataset codes/ pictures                               every code in a folder, drawn as FractalDB does
  fractal-dataset plants.ifs fern pictures --draw points        all codes of a file, and a classic
  fractal-dataset random:10000 pictures --size 256 --repeats 1 --shards 10000    random codes, in shards
  fractal-dataset random:50:7 pictures --draw density --jitter 0 --no-flips      ten grey pictures of each"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-dataset`. arguments: those of the process if None."""
    parser = command_parser("fractal-dataset", DESCRIPTION)
    parser.add_argument("codes", nargs="+", help="a folder of files of codes, a file with one or several, FILE:NAME, a "
                        "classic, suite:INDEX, or random:COUNT or random:COUNT:SEED for so many codes as in the suite")
    parser.add_argument("folder", help="where to write")
    parser.add_argument("--order", metavar="COLUMNS", help=ORDER_HELP)
    parser.add_argument("--draw", default="patches", help="patches (of 3 × 3 dots), points, or density (grey levels)")
    parser.add_argument("--size", type=int, default=362, help="pixels a side")
    parser.add_argument("--points", type=int, default=100_000, help="of a picture")
    parser.add_argument("--jitter", type=float, default=0.4, help="of the entries of the maps; 0 leaves them alone")
    parser.add_argument("--repeats", type=int, default=10, help="drawings of each jittered code, of other points")
    parser.add_argument("--flips", action=argparse.BooleanOptionalAction, default=True,
                        help="four pictures of each drawing, or one")
    parser.add_argument("--probabilities", default="own", help="of the maps: own (the code's), areas (of the jittered "
                        "maps), or random in each drawing")
    parser.add_argument("--seed", type=int, default=0, help="of the points")
    parser.add_argument("--shards", type=int, metavar="COUNT", help="write shards of so many pictures")
    command("fractal-dataset", write_dataset, parser, arguments)


def write_dataset(options: argparse.Namespace) -> None:
    """Write what the command line asks for."""
    from ..datasets import Fractals, write
    from ..runtime.bars import progress_bar

    named = [each for text in options.codes for each in codes_named(text, options.order)]
    choices = {key: value for key, value in vars(options).items() if key not in ("codes", "folder", "shards", "order")}
    fractals = Fractals([code for _, code in named], **choices)
    count = f"{len(named)} code{'s' * (len(named) > 1)}"
    print(f"{fractals.pictures} pictures of {count} in {Path(options.folder).absolute()}")
    with progress_bar(total=fractals.pictures, unit="picture", delay=1) as bar:
        there = write(fractals, [name for name, _ in named], options.folder, options.shards, bar.update)
    print(f"{fractals.pictures - there} were drawn" + (f", {there} were there" if there else ""))


def codes_named(text: str, order: str | None = None) -> list[tuple[str, IFS]]:
    """All codes that a word of the command line names, each with a name. order: of the columns in files of rows. Raises
    `InputError` if there is none, or if a folder holds anything else."""
    from ..ifs import formats
    from ..suite import random_suite
    from .code_names import read_codes

    if text.startswith("random:"):
        found = re.fullmatch(r"random:(\d{1,6})(?::(\d{1,19}))?", text)
        if not found:
            raise InputError("random codes are named random:COUNT or random:COUNT:SEED, with a count of up to 999999, "
                             f"got {text!r}")
        return [(str(code.meta["name"]), code) for code in random_suite(int(found[1]), int(found[2] or SEED))]
    path, known = Path(text), tuple(formats.suffixes())
    if path.is_dir() and not (path / "code.json").is_file():
        files = sorted(file for file in path.rglob("*") if file.is_file()
                       and not any(part.startswith(".") for part in file.relative_to(path).parts))
        others = [file for file in files if file.suffix.lower() not in known]
        if others or not files:
            what = f"{others[0].relative_to(path)}, which is no file" if others else "no file"
            raise InputError(f"{path} holds {what} of codes ({', '.join(known)}); name a folder that holds nothing "
                             "else, or the files of codes")
        return [named for file in files for named in codes_named(str(file), order)]
    found = read_codes(text, order=order)
    if len(found) == 1:
        return [(path.stem if path.is_file() else text, found[0])]
    return [(str(code.meta.get("name") or path.stem), code) for code in found]
