"""`fractal-invert`: from a picture to its code, in a folder. A plain command line: no configuration, no tracking."""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shlex
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..methods import METHODS
from ..runtime import threads
from ..runtime.files import make_folder
from . import interruption
from .commands import command, command_parser
from .reading import add_reading, read_picture

if TYPE_CHECKING:
    from ..images.reading import ReadImage
    from ..inversion import Inversion
    from ..methods.base import Progress

FLAGS = {name: f"--{name}" for name in ("method", "resolution", "invert", "threshold", "crop", "frame", "levels",
                                         "seed", "seconds", "colour")}
FLAGS["clean"] = "--as-it-is"
CHANGED = FLAGS | {"maps": "--maps"}  # flags of what a remedy may change

STOPPING = "fractal-invert: stopping; the best code so far is being written, if there is one"

DESCRIPTION = """Find the code of the self-similar shape on a picture: the few affine maps whose attractor it is.

PICTURE is a PNG, JPEG, GIF, BMP, TIFF, WebP or PPM file with one shape on a background of one colour. Captions, axes,
frames and specks beside it are ignored, and what is done is said. At the end stands a verdict: whether the shape was
recovered, approximated or not recovered, and what may help.

Written to --output: code.json (for fractal-render), inversion.json (the code and all that is known of it), target.png
(the picture as it was taken), redrawn.png (the code drawn like the picture, to compare with it), rendering.png (the
code alone), code.html (a page of it), for a picture of at most 4096 px a side overlay.png (the picture with what the
code lacks in orange and what it has too much in blue) and, where maps were grown, answers.png (codes of few and of many
maps, whole and 16 times closer). Ctrl-C ends the search and writes the best code so far.

examples
  fractal-invert leaf.png                                    writes leaf-fractal
  fractal-invert leaf.png --seconds 60 --maps 4
  fractal-invert scan.jpg --invert true --output scan        a black shape on white
  fractal-invert page.png --crop 40 60 340 380               the part from (40, 60) to (340, 380)
  fractal-invert leaf.png --colour                           and the colours of the maps
  fractal-invert leaf.png --set search.moves=100 rounds=2    any parameter of collage search (docs/method.md)"""


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = command_parser("fractal-invert", DESCRIPTION)
    parser.add_argument("picture", help="file of the picture")
    parser.add_argument("--output", metavar="FOLDER", help="to write to (default: NAME-fractal, here)")
    parser.add_argument("--force", action="store_true", help="write even if that folder holds something")
    parser.add_argument("--seconds", type=float, help="limit of the search; the best code so far is taken (default: "
                                                      "60 s of a core for a picture from elsewhere)")
    parser.add_argument("--method", default="collage", metavar="NAME", help=f"one of {', '.join(METHODS)} (default: "
                                                                            "collage, collage search)")
    parser.add_argument("--maps", type=int, help="number of maps (default: found)")
    parser.add_argument("--resolution", type=int, default=256, help="pixels a side that the picture is brought to")
    parser.add_argument("--seed", type=int, default=0, help="of every random number")
    add_reading(parser)
    parser.add_argument("--colour", action="store_true", help="give the code the picture's colours too")
    parser.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", dest="settings",
                        help="parameters of the method, such as search.moves=100 of collage search")
    parser.set_defaults(words=sys.argv[1:] if arguments is None else arguments)
    command("fractal-invert", invert_picture, parser, arguments)


def invert_picture(options: argparse.Namespace) -> None:
    """Do what the command line asks for."""
    from ..api import built, invert
    from ..inversion import write
    from ..inversion.road import INTERRUPTED
    from ..inversion.writing import LARGEST_OVERLAY, OVERLAY

    interruption.listen(STOPPING)
    threads.use()
    settings = parse_settings(options.settings)
    if options.maps is not None:
        settings["maps"] = options.maps
    folder = _folder(options)
    picture = read_picture(options.picture, options)
    print(f"{Path(options.picture).name}: {picture.source_size[0]}×{picture.source_size[1]} px")
    _print_list(note if note not in picture.warnings else f"beware: {note}" for note in picture.notes)
    limit = built(picture, options.method, seed=options.seed, seconds=options.seconds, **settings).deadline(picture)
    if options.seconds is None and limit.seconds:
        print(f"  searched for at most {limit.words}; --seconds gives another one")
    try:
        found = invert(picture, method=options.method, colour=options.colour, seed=options.seed,
                       seconds=options.seconds, progress=sys.stderr.isatty(), on_step=_tell, keep_interrupted=True,
                       **settings)
    except KeyboardInterrupt:
        print("\nfractal-invert: interrupted before there was a code that could be written", file=sys.stderr)
        raise SystemExit(130) from None
    make_folder(folder)
    _print_list(f"beware: {warning}" for warning in found.warnings if warning not in picture.warnings
                and (found.verdict.remedy or warning) not in warning)  # the verdict is told below
    written = write(found, folder)
    if OVERLAY not in written:
        print(f"  no overlay: the picture has more than {LARGEST_OVERLAY} px a side")
    print(f"  verdict    {found.verdict.words}")
    if remedy := may_help(found, options, picture, settings):
        print(f"  may help   {remedy}")
    for note in found.notes:
        if note not in (*picture.notes, *found.warnings):
            print(f"  note       {note}")
    print(f"  likeness   {found.likeness}")
    print(f"  dimension  {found.dimension}")
    print(f"  maps       {len(found.code)}, found in {found.seconds:.0f} s; {found.stopped}")
    print(f"  written    {folder}: {', '.join(written)}")
    if found.stopped == INTERRUPTED:
        print("fractal-invert: interrupted; the best code so far was written", file=sys.stderr)
        raise SystemExit(130)


def may_help(found: Inversion, options: argparse.Namespace, picture: ReadImage, settings: Mapping[str, Any]) -> str:
    """What may help, as the command line with one thing changed; in words where it is nothing to type, and empty where
    the method does not take it. What was found stays: the command writes to a folder that is not there yet, unless it
    was told to overwrite. settings: of the method, as they were given."""
    if not found.verdict.change:
        return found.verdict.remedy
    [(key, value)] = found.verdict.change.items()
    if key not in FLAGS and not _is_taken(options, picture, {**settings, key: value}):
        return ""
    text = f"{value:g}" if isinstance(value, float) else str(value).lower()
    told = {CHANGED[key]: text} if key in CHANGED else {}
    if not options.force:
        folder = options.output or f"{Path(options.picture).stem}-fractal"
        told["--output"] = next(name for i in itertools.count(2) if not Path(name := f"{folder}-{i}").exists())
    words = iter(options.words)
    kept = [word for word in words if not (word in told and next(words) is not None) and word.split("=")[0] not in told]
    changed = [word for pair in told.items() for word in pair] + ([] if key in CHANGED else ["--set", f"{key}={text}"])
    return shlex.join(["fractal-invert", *kept, *changed])


def _is_taken(options: argparse.Namespace, picture: ReadImage, settings: Mapping[str, Any]) -> bool:
    """Whether the method can work on the picture with these settings: trained weights know one number of maps."""
    from ..api import built

    try:
        built(picture, options.method, seed=options.seed, seconds=options.seconds, **settings).check(picture)
    except InputError:
        return False
    return True


def parse_settings(words: list[str]) -> dict[str, Any]:
    """KEY=VALUE as nested options: search.moves=10 as {"search": {"moves": 10}}. Raises `InputError` on other words."""
    from ..api import OWN

    settings: dict[str, Any] = {}
    for word in words:
        key, equals, text = word.partition("=")
        *folders, last = key.split(".")
        if not (equals and text and all([*folders, last])):
            raise InputError(f"--set takes KEY=VALUE, such as search.moves=10, got {word!r}")
        if (first := key.split(".")[0]) in OWN:
            flag = f"; use {FLAGS[first]}" if first in FLAGS else ""
            raise InputError(f"--set {word}: {first} is no parameter of the method{flag}")
        inner = settings
        for folder in folders:
            inner = inner.setdefault(folder, {})
            if not isinstance(inner, dict):
                raise InputError(f"--set {word}: {folder} has a value already, and is no component")
        inner[last] = _value(text)
    return settings


def _value(text: str) -> Any:
    """A number, a list, true, false or null as JSON has them; anything else is a text."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def _folder(options: argparse.Namespace) -> Path:
    """Where to write. Raises `InputError` if something is there already."""
    folder = Path(options.output or f"{Path(options.picture).stem}-fractal").absolute()
    there = next(each for each in (folder, *folder.parents) if each.exists())
    if not there.is_dir():
        raise InputError(f"{there} is a file; name a folder with --output")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"{there} may not be written to; name another folder with --output")
    if folder.is_dir() and any(folder.iterdir()) and not options.force:
        raise InputError(f"{folder} holds something already; --force writes into it, --output names another folder")
    return folder


def _tell(progress: Progress) -> None:
    """One line at the end of each stage, where there is no terminal for a bar."""
    interruption.check()
    if progress.code is not None and not sys.stderr.isatty():
        print(f"  {100 * progress.fraction:3.0f}% {progress.describe()}", flush=True)


def _print_list(lines: Iterable[str]) -> None:
    for line in lines:
        print(f"  {line}")
