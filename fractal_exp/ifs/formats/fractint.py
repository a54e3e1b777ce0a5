"""FRACTINT's `.ifs` files: several named codes as text, with comments."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced
from typing import Any

from ...errors import InputError
from ..code import IFS
from ..numbers import MOST_MAPS
from .base import CodeFormat, Entry, check_codes, check_count, code_of, number_of, plain, text_of
from .own import rows_of

PIECES = re.compile(r"[{}]|;[^\n\r]*|[^{};\n\r]+")  # of a line: a brace, a comment, or what stands between
UNSAFE = re.compile(r"[^A-Za-z0-9_.+-]+")
LONGEST_NAME, MOST_COMMENT = 60, 2000  # characters that are kept
IN_3D = 13                             # numbers of a map in space
MOST_NUMBERS = IN_3D * MOST_MAPS       # of an entry


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
        taken: dict[str, int] = {}
        return "\n".join(_written(code.check_contractive(), taken) for code in codes).encode()


@dataclass(frozen=True)
class _Block:
    """An entry: the header before its braces, and the text between them, which is read when its code is asked for."""

    header: str
    body: str

    @property
    def name(self) -> str | None:
        return plain(self.header.partition("(")[0]) or None

    def code(self) -> IFS:
        """The code. Raises `InputError` that begins with the entry's name."""
        try:
            if "(3D)" in self.header.upper().replace(" ", ""):
                raise InputError("is a code in space (3D); only codes in the plane are read, of 6 or 7 numbers a map")
            lines, comments = self._words_and_comments()
            maps = _maps(lines)
            meta: dict[str, Any] = {} if self.name is None else {"name": self.name}
            comment = "\n".join(filter(None, comments))[:MOST_COMMENT]
            meta |= {"comment": comment} if comment else {}
            return code_of([row[:6] for row in maps], [row[6] for row in maps] if len(maps[0]) == 7 else None, meta)
        except InputError as error:
            raise InputError(f"entry {plain(self.header, 40)!r}: {error}") from None

    def _words_and_comments(self) -> tuple[list[list[str]], list[str]]:
        """The words of each line that has any, and as many comments as are kept. Raises `InputError` if there are more
        words than a code has numbers."""
        lines: list[list[str]] = []
        comments: list[str] = []
        left = MOST_NUMBERS
        for found in PIECES.finditer(self.body):
            piece = found[0]
            if piece[0] != ";":
                words = piece.replace(",", " ").split(None, left + 1)
                left -= len(words)
                if left < 0:
                    raise InputError(f"has more than {MOST_NUMBERS} numbers; a code has from 1 to {MOST_MAPS} maps")
                lines += [words] if words else []
            elif len(comments) < MOST_COMMENT:
                comments.append(plain(piece[1:]))
        return lines, comments


def _blocks(text: str) -> list[_Block]:
    """All entries but comments. Raises `InputError` if braces do not match, or on more codes than a file may have."""
    blocks: list[_Block] = []
    begun, header, start = False, "", 0
    for found in PIECES.finditer(text):
        piece = found[0]
        if piece == "{" and begun:
            raise InputError(f"entry {plain(header, 40)!r} has a second '{{'; end each entry with '}}'")
        elif piece == "{":
            begun, header, start = True, header.strip(), found.end()
        elif piece == "}":
            if begun and header.lower() != "comment":
                blocks.append(_Block(header, text[start:found.start()]))
                check_codes(len(blocks))
            begun, header = False, ""
        elif not begun and piece[0] != ";" and piece.strip():
            header = piece
    if begun:
        raise InputError(f"entry {plain(header, 40)!r} does not end; close it with '}}'")
    return blocks


def _maps(lines: list[list[str]]) -> list[list[float]]:
    """Rows of six or seven numbers, from the words of each line. A map is a line, or seven numbers across lines."""
    lengths = {len(line) for line in lines}
    flat = [word for line in lines for word in line]
    if lengths == {IN_3D}:
        raise InputError("has 13 numbers a map, as codes in space do; only codes in the plane are read")
    width = 6 if lengths == {6} else 7
    if not flat or len(flat) % width:
        raise InputError(f"has {len(flat)} numbers; a map is a line of 6, a b c d e f, or of 7 with its probability, "
                         "the same for all maps")
    check_count(len(flat) // width)
    numbers = [number_of(word, f"number {i + 1}") for i, word in enumerate(flat)]
    return [numbers[i:i + width] for i in range(0, len(numbers), width)]


def _written(code: IFS, taken: dict[str, int]) -> str:
    """The text of an entry, under a name that is not taken yet."""
    rows = rows_of(replaced(code, probabilities=code.sampling_probabilities()))
    notes = [plain(line) for key in ("title", "source", "comment")
             for line in (code.meta[key].splitlines() if isinstance(code.meta.get(key), str) else [])]
    lines = [f"{_free_name(plain(code.meta.get('name')), taken)} {{", *(f"  ; {note}" for note in notes if note),
             *("  " + " ".join(f"{number:g}" if number.is_integer() else repr(number) for number in row)
               for row in rows), "}"]
    return "\n".join(lines) + "\n"


def _free_name(name: str, taken: dict[str, int]) -> str:
    """A name that is not taken; taken: how often each was asked for."""
    base = UNSAFE.sub("_", name)[:LONGEST_NAME].strip("_") or "code"
    base = "comment_" if base.lower() == "comment" else base
    free = base
    while free in taken:
        taken[base] += 1
        free = f"{base}_{taken[base]}"
    taken[free] = 1
    return free
