"""File formats for codes, chosen by the file's suffix."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Generator, Sequence
from pathlib import Path

from ...errors import InputError, did_you_mean
from ...runtime.files import LARGEST_JSON, read_file, write_atomically
from ..code import IFS
from .base import CodeFormat, Entry, Import, choose, code_of
from .flame import FlameFile
from .fractint import Fractint, Table
from .own import Json, Lists, Rows, from_json
from .ply import Ply
from .rows import check_order

__all__ = ["FORMATS", "CodeFormat", "Entry", "Import", "code_of", "from_json", "listing", "load", "of_file", "read",
           "register", "save", "suffixes"]

LARGEST = LARGEST_JSON  # bytes of a file that is read
FORMATS: dict[str, CodeFormat] = {each.key: each for each in (
    Json(), Lists(), Rows(), Table(), Fractint(), FlameFile(), Ply())}
DEFAULT = FORMATS["json"]


def register(format: CodeFormat) -> None:
    """Add a format, so that `IFS.load`, `IFS.save` and the commands know it. Raises `InputError` if its key or one of
    its suffixes is taken."""
    taken = suffixes().keys() & set(format.suffixes)
    if format.key in FORMATS or taken:
        what = f"suffix {sorted(taken)[0]!r}" if taken else f"key {format.key!r}"
        raise InputError(f"a format with the {what} is registered already; choose another")
    FORMATS[format.key] = format


def suffixes() -> dict[str, CodeFormat]:
    """The format of each suffix."""
    return {suffix: format for format in FORMATS.values() for suffix in format.suffixes}


def load(path: str | Path, name: str | None = None, order: str | None = None) -> IFS:
    """Read a code from a JSON (see `from_json`), table (`.csv`, `.txt`), Fractint (`.ifs`) or flam3 (`.flame`) file.

    name: which code of a file with several, in any letter case, or "#2" for the second. order: of the columns in rows
    of numbers, which no file tells: "abcdefp" unless given, for x' = a x + b y + e, y' = c x + d y + f and the
    probability p; "abecdf" for the two rows of a matrix of 2 x 3. A file whose suffix no format has is read as JSON.
    Raises `InputError` naming the file. `formats.read` also reports what was left out.
    """
    return read(path, name, order).code


def read(path: str | Path, name: str | None = None, order: str | None = None) -> Import:
    """A code as `load` reads it, and the report of its reader."""
    entries = listing(path, order)
    with _naming(path):
        return choose(entries, name)


def listing(path: str | Path, order: str | None = None) -> list[Entry]:
    """The codes of a file, each with its name and the function that reads it. Raises `InputError` naming the file."""
    format = copy.copy(suffixes().get(Path(path).suffix.lower(), DEFAULT))
    data = read_file(path, "the code", LARGEST)
    with _naming(path):
        if order is not None and not format.rows:
            raise InputError(f"{format.key} files have no rows of numbers; leave order (--order) out")
        format.order = None if order is None else check_order(order)
        return format.entries(data)


@contextlib.contextmanager
def _naming(path: str | Path) -> Generator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{Path(path).absolute()}: {error}") from error


def save(codes: IFS | Sequence[IFS], path: str | Path, format: str | None = None) -> Path:
    """Write a code, or several, to a file, whole or not at all, and return its absolute path.

    The suffix chooses the format: `.json` (the complete code, bit for bit; also without a suffix), `.csv` (a table),
    `.ifs` (Fractint), `.flame` (flam3), `.svg` (a drawing of the maps), `.ply` (points). format: its key instead:
    "json", "lists", "rows", "table", "fractint", "flame", "svg" or "ply". The class of each format says what it loses.
    Raises `InputError` on another suffix or format, if the file cannot be written, or if the format cannot hold the
    codes.
    """
    path = Path(path).absolute()
    write_atomically(path, of_file(path, format).write([codes] if isinstance(codes, IFS) else codes))
    return path


def of_file(path: str | Path, key: str | None = None) -> CodeFormat:
    """The format in which a file is written: by key, or else by the path's suffix; JSON if it has no suffix.

    Raises `InputError` if there is none.
    """
    path, by_suffix = Path(path), suffixes()
    if key is not None:
        if key not in FORMATS:
            raise InputError(f"no format is called {key!r}{did_you_mean(str(key), FORMATS) or ';'} there are "
                             f"{', '.join(FORMATS)}")
        return FORMATS[key]
    if path.suffix and path.suffix.lower() not in by_suffix:
        raise InputError(f"no format of codes ends in {path.suffix!r}{did_you_mean(path.suffix, by_suffix) or ';'} "
                         f"there are {', '.join(by_suffix)}; name one with format= (--to), or change the suffix")
    return by_suffix.get(path.suffix.lower(), DEFAULT)
