"""`fractal-suite`: the random suite as files. A plain command line, since there is nothing to compose."""

from __future__ import annotations

import argparse
import json

from ..errors import InputError
from ..runtime import threads
from ..runtime.files import make_folder, write_atomically
from .commands import LARGEST, command, command_parser

COUNT, SEED = 100, 2025  # of the project's results
SMALL = 256              # pixels a side at most, so that a hundred pictures may wait for the sheet

DESCRIPTION = """Write the random suite: codes, target images and a contact sheet.

  FOLDER/codes/007.json     the code of fractal 7, in the frame of its image
  FOLDER/targets/007.png    its target image
  FOLDER/sheet.png          all of them at a glance
  FOLDER/suite.json         how they were made

The default seed is that of the project's results, so that everybody has the same hundred fractals.

examples
  fractal-suite suite                                  the suite, grey, 1024 pixels
  fractal-suite suite-256 --resolution 256 --binary    at laptop scale, black and white
  fractal-suite mine --count 20 --seed 7               twenty other fractals of the same distribution"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-suite`. arguments: those of the process if None."""
    parser = command_parser("fractal-suite", DESCRIPTION)
    parser.add_argument("folder", help="where to write")
    parser.add_argument("--count", type=int, default=COUNT, help="how many fractals")
    parser.add_argument("--seed", type=int, default=SEED, help="of the suite")
    parser.add_argument("--resolution", type=int, default=1024, help="pixels a side")
    parser.add_argument("--binary", action="store_true", help="black and white (above 0.25) instead of grey")
    parser.add_argument("--bits", type=int, choices=(8, 16),
                        help="of the images (default: 16, as 8 would round grey levels; 8 with --binary)")
    command("fractal-suite", write_suite, parser, arguments)


def write_suite(options: argparse.Namespace) -> None:
    """Write what the command line asks for."""
    from torch.nn.functional import adaptive_avg_pool2d

    from ..ifs import attractor
    from ..images.pixels import write_image
    from ..rendering.sheets import contact_sheet
    from ..runtime.bars import progress_bar
    from ..suite import TARGET_KINDS, random_suite, target

    suite = random_suite(options.count, options.seed)
    if not 1 <= options.resolution <= LARGEST:
        raise InputError(f"the resolution must be from 1 to {LARGEST}, got {options.resolution}")
    folder = make_folder(options.folder)
    codes, targets = make_folder(folder / "codes"), make_folder(folder / "targets")
    kind, bits = TARGET_KINDS[options.binary], options.bits or (8 if options.binary else 16)
    threads.use()
    small, names = [], [f"{index:03d}" for index in range(len(suite))]
    for name, code in zip(progress_bar(names, desc="drawing", unit="fractal"), suite, strict=True):
        attractor.normalize(code).save(codes / f"{name}.json")
        image = target(code, options.resolution, kind)
        write_image(targets / f"{name}.png", image, bits=bits)
        small.append(image if len(image) <= SMALL else adaptive_avg_pool2d(image[None], SMALL)[0])
    write_image(folder / "sheet.png", contact_sheet(small, names))
    facts = {"count": options.count, "seed": options.seed, "resolution": options.resolution, "kind": kind}
    write_atomically(folder / "suite.json", json.dumps(facts, indent=1) + "\n")
    print(f"{len(suite)} fractals in {folder}; all at a glance: {folder / 'sheet.png'}")
