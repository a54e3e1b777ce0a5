"""What all formats share: the base class, the choice among several codes, and safe reading of numbers."""

from __future__ import annotations

import codecs
import math
import re
import reprlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import torch

from ...errors import InputError, did_you_mean
from ..code import IFS
from ..colours import Colours
from ..numbers import MOST_MAPS

MOST_CODES = 10_000  # of one file
MOST_LISTED = 12     # names in an error message
LOOKED_AT = 10       # times the characters of a note that are kept
NORMALISED = 1e-3    # weights whose sum is closer to 1 than this stay as they are
DECLARED = re.compile(rb"""<\?xml[^>]{0,100}?encoding\s*=\s*["'](iso-8859-(?:[1-9]|1[013-6])|windows-125[0-8]|"""
                      rb"""koi8-[ru]|shift_jis|euc-jp|euc-kr|gbk|gb18030|big5)["']""", re.IGNORECASE)
NUMBER = re.compile(r"[+-]?(\d++(\.\d*+)?|\.\d++)([eE][+-]?\d++)?", re.ASCII)  # no digit is looked at twice


@dataclass(frozen=True)
class Import:
    """A code from a file, and the report of its reader: what was read, what was left out or taken for granted, and why,
    a line each. The package's own JSON needs no report."""

    code: IFS
    report: tuple[str, ...] = ()


@dataclass(frozen=True)
class Entry:
    """One code of a file: its name, if it has one, and `read`, which makes the code or raises `InputError`.

    Only the code that is asked for is made, so one bad entry does not spoil a file of a hundred good ones.
    """

    name: str | None
    read: Callable[[], Import]


class CodeFormat:
    """A format of files that hold codes.

    key: its name in `IFS.save(path, format=…)` and `fractal-convert --to`. suffixes: of its files, in lower case, the
    usual one first. several: whether a file may hold more than one code. rows: whether it has rows of numbers, whose
    order of columns is then `order`, or None if nothing is said of it. A format overrides `entries` if it can be read
    and `write` if it can be written.
    """

    key: str
    suffixes: tuple[str, ...] = ()
    several = rows = False
    order: str | None = None

    def entries(self, data: bytes) -> list[Entry]:
        """The codes in a file's bytes, which may come from anywhere. Raises `InputError`."""
        raise InputError(f"{self.key} files are written, not read; keep the code's JSON file beside them")

    def write(self, codes: Sequence[IFS]) -> bytes:
        """A file's bytes. Raises `InputError` if the format cannot hold the codes."""
        raise InputError(f"{self.key} files are read, not written")


def choose(entries: Sequence[Entry], name: str | None) -> Import:
    """The code called `name`, if need be in other letter case, or numbered #1, #2 … in the order of the file; without a
    name, the only code.

    Raises `InputError`, with a list of the names, if no code or several codes match.
    """
    if not entries:
        raise InputError("the file holds no code")
    found = [i for i, entry in enumerate(entries) if name in (None, entry.name)]
    if not found and name:
        found = [i for i, entry in enumerate(entries) if (entry.name or "").casefold() == name.casefold()]
    number = re.fullmatch(r"#(\d{1,9})", name or "")
    if not found and number and 1 <= int(number[1]) <= len(entries):
        found = [int(number[1]) - 1]
    if len(found) == 1:
        return entries[found[0]].read()
    if name is None:
        raise InputError(f"the file holds {len(entries)} codes; choose one, as in IFS.load(path, name) or FILE:NAME: "
                         f"{listed(entries)}")
    if found:
        numbers = ", ".join(f"#{i + 1}" for i in found[:MOST_LISTED])
        raise InputError(f"{len(found)} codes are called {reprlib.repr(name)}; choose by number: {numbers}")
    near = did_you_mean(name[:100], [entry.name for entry in entries if entry.name and len(entry.name) < 100][:1000])
    raise InputError(f"the file holds no code called {reprlib.repr(name)}{near or ';'} it holds {listed(entries)}")


def listed(entries: Sequence[Entry]) -> str:
    """Names of entries for an error message: the first twelve, with numbers for entries without a name."""
    names = [f"#{i + 1}" if entry.name is None else reprlib.repr(entry.name)
             for i, entry in enumerate(entries[:MOST_LISTED])]
    more = len(entries) - len(names)
    return ", ".join(names) + (f" and {more} more" if more > 0 else "")


def text_of(data: bytes) -> tuple[str, tuple[str, ...]]:
    """A file's bytes as text, without the final 0x1A of DOS files, and a note if some letters may be wrong.

    It is UTF-16 with a byte order mark, or UTF-8, or what an XML declaration says, or else Windows-1252, which has all
    of Latin-1. Raises `InputError` if it is empty or no text.
    """
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    notes: tuple[str, ...] = ()
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        declared = DECLARED.match(data)
        text = data.decode(declared[1].decode() if declared else "cp1252", "replace")
        notes = () if declared else ("read as Windows-1252, as it is not UTF-8; letters of names may be wrong",)
    text = text.rstrip("\x1a")
    if not text.strip():
        raise InputError("the file is empty")
    if "\0" in text:
        raise InputError("the file is no text, as it has the character 0; name a file of codes")
    return text, notes


def number_of(text: str, what: str) -> float:
    """A finite number in decimal notation. Raises `InputError` that names it as `what`."""
    if not NUMBER.fullmatch(text):
        point = "; write a point for a decimal comma, or put commas between all numbers" if "," in text else ""
        raise InputError(f"{what} must be a number, got {reprlib.repr(text)}{point}")
    value = float(text)
    if not math.isfinite(value):
        raise InputError(f"{what} must be a finite number, got {reprlib.repr(text)}")
    return value


def numbers_of(text: str, count: int, what: str) -> list[float]:
    """`count` finite numbers between spaces. Raises `InputError` that names them as `what`."""
    words = text.split(None, count)  # and what is left over
    if len(words) != count:
        raise InputError(f"{what} must be {count} numbers, got {reprlib.repr(text)}")
    return [number_of(word, what) for word in words]


def code_of(rows: Any, weights: Sequence[float] | None, meta: dict[str, Any], notes: Sequence[str] = (),
            colours: Colours | None = None) -> Import:
    """The contractive code with rows a b c d e f, and the report of what was read, which ends with the notes.

    Weights are divided by their sum unless it is 1. They are added up until the sum exceeds a random number, as
    Fractint does, so that a map of a weight below 0 is never chosen. Raises `InputError`.
    """
    check_count(len(rows))
    has = [name for name, given in (("probabilities", weights), ("colours", colours)) if given is not None]
    report = [f"{len(rows)} map{'s' * (len(rows) > 1)} read" + (f", with {' and '.join(has)}" if has else "")]
    if weights is not None:
        if min(weights) < 0:
            sums = accumulate(accumulate(weights, initial=0.0), max)
            weights = [after - before for before, after in pairwise(sums)]
            report.append("weights below 0 are added up with those after them, as Fractint does")
        total = sum(weights)
        if not 0 < total < math.inf:
            raise InputError("the maps' weights must have a sum above 0 that is not huge; correct them, or leave them "
                             "all out")
        if never := ", ".join(str(i) for i, weight in enumerate(weights, 1) if weight == 0):
            report.append(f"never chosen, as its weight is not above 0: map {plain(never)}")
        if abs(total - 1) > NORMALISED:
            report.append(f"weights are divided by their sum, {total:.6g}")
            weights = [weight / total for weight in weights]
    table = torch.tensor(rows, dtype=torch.float64)
    probabilities = None if weights is None else torch.tensor(weights, dtype=torch.float64)
    code = IFS(table[:, :4].reshape(-1, 2, 2), table[:, 4:], probabilities, meta, colours).check_contractive()
    return Import(code, (*report, *notes))


def check_count(maps: int) -> None:
    """Raise `InputError` unless a code may have this number of maps."""
    if not 1 <= maps <= MOST_MAPS:
        raise InputError(f"a code has from 1 to {MOST_MAPS} maps, got {maps}" if maps else "the code has no map")


def check_codes(codes: int) -> None:
    """Raise `InputError` if a file has more codes than are read."""
    if codes > MOST_CODES:
        raise InputError(f"the file holds more than {MOST_CODES} codes, at most so many are read; split it")


def only_one(codes: Sequence[IFS], key: str) -> IFS:
    """The only code for a file that holds one. Raises `InputError` if there are several."""
    if len(codes) != 1:
        raise InputError(f"a {key} file holds one code, got {len(codes)}; write one file a code")
    return codes[0]


def plain(text: Any, most: int = 200) -> str:
    """A note on one line without control characters, cut to `most` characters; empty if it is not text."""
    words = " ".join(text[:LOOKED_AT * most].split()) if isinstance(text, str) else ""
    return "".join(letter for letter in words if letter.isprintable())[:most]
