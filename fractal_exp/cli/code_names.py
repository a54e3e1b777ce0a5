"""Which code a command line names: a file, a classic, a fractal of the suite."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from PIL import Image

from .. import codes
from ..errors import InputError, did_you_mean
from ..ifs import attractor, formats
from ..ifs.code import IFS
from ..images.bands import FORMATS
from ..suite import SUITE_SEED, random_suite
from .commands import CODE_HELP, tell


def read_code(text: str, frame: str = "own", order: str | None = None) -> IFS:
    """The code that a command line names, brought to the canvas if `frame` says so. What its reader reports is told.
    order: of the columns in a file of rows. Raises `InputError` if there is none."""
    return _framed(_code(text, order), frame)


def read_codes(text: str, frame: str = "own", order: str | None = None) -> list[IFS]:
    """The code that a command line names, or all those of a file with several that can be read; of others it is told
    why not. Raises `InputError` if there is none."""
    path, name = file_and_name(text)
    if name is not None or not path.is_file() or len(entries := formats.listing(path, order)) < 2:
        return [read_code(text, frame, order)]
    found: list[IFS] = []
    for i, entry in enumerate(entries, 1):
        source = f"{path}:{entry.name or f'#{i}'}"
        try:
            found.append(_framed(_told(entry.read(), source), frame))
        except InputError as error:
            tell(f"{source}: not read: {error}")
    if not found:
        raise InputError(f"{path.absolute()}: none of the {len(entries)} codes can be read, as told above")
    return found


def _told(found: formats.Import, source: str) -> IFS:
    """The code that was found, after its report is told."""
    for line in found.report:
        tell(f"{source}: {line}")
    return found.code


def _framed(code: IFS, frame: str) -> IFS:
    return attractor.normalize(code) if frame == "canvas" else code


def _code(text: str, order: str | None) -> IFS:
    if text.startswith("suite:") and order is None:
        index, seed = suite_address(text)
        return random_suite(index + 1, seed)[index]
    path, name = file_and_name(text)
    if path.is_dir() and (path / "code.json").is_file():
        path = path / "code.json"
    if _may_be_file(path):
        return load_code(path, name, order)
    if order is not None:
        raise InputError(f"{text!r} is no file with rows of numbers; leave --order out")
    if text.lower() in codes.names():
        return codes.known(text.lower())
    near = did_you_mean(text, codes.names())
    raise InputError(f"{text!r} is no file and no classic code{near or ';'} give {CODE_HELP.removeprefix('a code: ')}")


def load_code(path: Path, name: str | None = None, order: str | None = None) -> IFS:
    """`IFS.load`, which tells what the reader reports, and whose `InputError` on a picture names the command that finds
    its code."""
    try:
        return _told(formats.read(path, name, order), str(path))
    except InputError:
        if is_picture(path):
            raise InputError(f"{path} is a picture, and a code is asked for; fractal-invert {shlex.quote(str(path))} "
                             "finds one") from None
        raise


def is_picture(path: Path) -> bool:
    """Whether a file is there that begins like a picture."""
    try:
        with Image.open(path, formats=FORMATS):
            return True
    except Exception:  # Pillow's own kinds, by what is wrong
        return False


def names_picture(text: str) -> bool:
    """Whether a text names a picture: a file that begins like one, or none that would be called like one."""
    path = Path(text)
    kind = None if path.exists() else Image.registered_extensions().get(path.suffix.lower())
    return kind in FORMATS or is_picture(path)


def file_and_name(text: str) -> tuple[Path, str | None]:
    """FILE:NAME as its parts; a file that is there, or a suffix, decides which colon it is."""
    if not os.path.exists(text):
        for colon in (i for i, letter in enumerate(text) if letter == ":"):
            if _may_be_file(Path(text[:colon])):
                return Path(text[:colon]), text[colon + 1:]
    return Path(text), None


def _may_be_file(path: Path) -> bool:
    return os.path.exists(path) or path.suffix.lower() in formats.suffixes()


def suite_address(text: str) -> tuple[int, int]:
    """Index and seed of suite:INDEX or suite:INDEX:SEED."""
    parts = text.split(":")[1:]
    if len(parts) not in (1, 2) or not all(part.isdigit() for part in parts):
        raise InputError(f"a fractal of the suite is named suite:INDEX or suite:INDEX:SEED, got {text!r}")
    return int(parts[0]), int(parts[1]) if len(parts) == 2 else SUITE_SEED
