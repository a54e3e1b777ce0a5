"""FRACTINT's `.ifs` files: several named codes as text, with comments."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from dataclasses import replace as replaced
from typing import Any

from ...errors import InputError
from ..code import IFS
from .base import CodeFormat, Entry, check_count, code_of, number_of, plain, text_of
from .own import rows_of

PIECES = re.compile(r"([{}])")
UNSAFE = re.compile(r"[^A-Za-z0-9_.+-]+")
LONGEST_NAME, MOST_COMMENT = 60, 2000  # characters that are kept
IN_3D = 13                             # numbers of a map in space


class Fractint(CodeFormat):
    """FRACTINT's text files: `name { a b c d e f p … }`, x' = a x + b y + e, y' = c x + d y + f.

    It follows the documentation of Fractint (`name` before a brace, `;` begins a comment, a map is seven numbers, an
    entry called `comment` is a comment, `(3D)` after the name marks a code in space) and of the IFS Construction Kit
    (six numbers per line are a map without a probability, commas may separate them, names may have spaces).
    Probabilities are divided by their sum if it is not 1. Entries in space are refused by name.

    `meta` gets `name` and the entry's `comment`. Name, title, source and comment are written, with underscores for what
    the format does not allow in names; other notes and colours are lost. Fractint needs probabilities, so a code
    without any is written with those of the chaos game.
    """

    key, suffixes, several = "fractint", (".ifs",), True

    def entries(self, data: bytes) -> list[Entry]:
        return [Entry(block.name, block.code) for block in _blocks(text_of(data))]

    def write(self, codes: Sequence[IFS]) -> bytes:
        taken: set[str] = set()
        return "\n".join(_written(code.check_contractive(), taken) for code in codes).encode()


@dataclass
class _Block:
    """An entry: the header before its braces, the lines between them without comments, and the comments."""

    header: str
    lines: list[str] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)

    @property
    def name(self) -> str | None:
        return plain(self.header.partition("(")[0]) or None

    def code(self) -> IFS:
        """The code. Raises `InputError` that begins with the entry's name."""
        try:
            if "(3D)" in self.header.upper().replace(" ", ""):
                raise InputError("is a code in space (3D); only codes in the plane are read, of 6 or 7 numbers a map")
            maps = _maps(self.lines)
            meta: dict[str, Any] = {} if self.name is None else {"name": self.name}
            comment = "\n".join(filter(None, map(plain, self.comments)))[:MOST_COMMENT]
            meta |= {"comment": comment} if comment else {}
            return code_of([row[:6] for row in maps], [row[6] for row in maps] if len(maps[0]) == 7 else None, meta)
        except InputError as error:
            raise InputError(f"entry {plain(self.header, 40)!r}: {error}") from None


def _blocks(text: str) -> list[_Block]:
    """All entries but comments. Raises `InputError` if braces do not match."""
    blocks: list[_Block] = []
    block, header = None, ""
    for line in text.splitlines():
        content, _, comment = line.partition(";")
        for piece in PIECES.split(content):
            if piece == "{" and block is not None:
                raise InputError(f"entry {plain(block.header, 40)!r} has a second '{{'; end each entry with '}}'")
            elif piece == "{":
                block, header = _Block(header.strip()), ""
            elif piece == "}":
                blocks += [block] if block is not None else []
                block, header = None, ""
            elif block is not None:
                block.lines.append(piece)
            else:
                header = piece if piece.strip() else header
        if block is not None:
            block.comments.append(comment)
    if block is not None:
        raise InputError(f"entry {plain(block.header, 40)!r} does not end; close it with '}}'")
    return [block for block in blocks if block.header.lower() != "comment"]


def _maps(lines: list[str]) -> list[list[float]]:
    """Rows of six or seven numbers. A map is a line, or seven numbers across lines."""
    words = [line.replace(",", " ").split() for line in lines]
    lengths = {len(line) for line in words if line}
    flat = [word for line in words for word in line]
    if lengths == {IN_3D}:
        raise InputError("has 13 numbers a map, as codes in space do; only codes in the plane are read")
    width = 6 if lengths == {6} else 7
    if not flat or len(flat) % width:
        raise InputError(f"has {len(flat)} numbers; a map is a line of 6, a b c d e f, or of 7 with its probability, "
                         "the same for all maps")
    check_count(len(flat) // width)
    numbers = [number_of(word, f"number {i + 1}") for i, word in enumerate(flat)]
    return [numbers[i:i + width] for i in range(0, len(numbers), width)]


def _written(code: IFS, taken: set[str]) -> str:
    """The text of an entry, under a name that is not taken yet."""
    rows = rows_of(replaced(code, probabilities=code.sampling_probabilities()))
    notes = [plain(line) for key in ("title", "source", "comment")
             for line in (code.meta[key].splitlines() if isinstance(code.meta.get(key), str) else [])]
    lines = [f"{_free_name(plain(code.meta.get('name')), taken)} {{", *(f"  ; {note}" for note in notes if note),
             *("  " + " ".join(f"{number:g}" if number.is_integer() else repr(number) for number in row)
               for row in rows), "}"]
    return "\n".join(lines) + "\n"


def _free_name(name: str, taken: set[str]) -> str:
    base = UNSAFE.sub("_", name)[:LONGEST_NAME].strip("_") or "code"
    base = "comment_" if base.lower() == "comment" else base
    free, count = base, 1
    while free in taken:
        count += 1
        free = f"{base}_{count}"
    taken.add(free)
    return free
