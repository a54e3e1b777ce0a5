"""Maps as rows of numbers in a text: FRACTINT's `.ifs` files of several named codes, and plain tables."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced
from typing import Any

from ...errors import InputError
from ..code import IFS
from ..numbers import MOST_MAPS
from .base import CodeFormat, Entry, Import, check_codes, code_of, only_one, plain, text_of
from .own import Json, rows_of
from .rows import BY_MATRICES, IN_3D, maps_of, words_of

# Of a text: a brace, a comment, or what stands between. "#" begins a comment in a line of its own, or after numbers.
PIECES = re.compile(r"[{}]|;[^\n\r]*|(?<![^\n\r])[ \t]*#[^\n\r]*|[^{};\n\r]+")
BETWEEN = re.compile(r"(?<=[\d.]);(?=[ \t]*[-+.\d])")  # so spreadsheets part numbers with decimal commas
JSON = re.compile(rb'\s*(\[|\{\s*")')
UNSAFE = re.compile(r"[^A-Za-z0-9_.+-]+")
LONGEST_NAME, MOST_COMMENT = 60, 2000  # characters that are kept
MOST_NUMBERS = IN_3D * MOST_MAPS       # of an entry
MEANING = "x' = a x + b y + e, y' = c x + d y + f"


class Fractint(CodeFormat):
    """FRACTINT's text files: `name { a b c d e f p … }`, x' = a x + b y + e, y' = c x + d y + f.

    It follows the documentation of Fractint (`name` before a brace, `;` begins a comment, a map is seven numbers, an
    entry called `comment` is a comment, `(3D)` after the name marks a code in space) and of the IFS Construction Kit
    (six numbers per line are a map without a probability, commas may separate them, names may have spaces). A text
    without braces is one code without a name, see `rows.maps_of`. Probabilities are divided by their sum if it is not
    1, and those below 0 mean what they mean to Fractint. Entries in space are refused by name.

    `meta` gets `name` and the comments in and before the entry. Name, title, source and comment are written, with
    underscores for what the format does not allow in names; other notes and colours are lost. Fractint needs
    probabilities, so a code without any is written with those of the chaos game.
    """

    key, suffixes, several, rows = "fractint", (".ifs",), True, True

    def entries(self, data: bytes) -> list[Entry]:
        text, notes = text_of(data)
        blocks = _blocks(text) if "{" in text or "}" in text else [_Block(None, BETWEEN.sub(" ", text))]
        return [Entry(block.name, lambda block=block: block.code(self.order, notes)) for block in blocks]

    def write(self, codes: Sequence[IFS]) -> bytes:
        taken: dict[str, int] = {}
        return "\n".join(_written(code.check_contractive(), taken) for code in codes).encode()


class Table(Fractint):
    """Text with a row of six or seven numbers for each map, between spaces or commas, read like Fractint's files.

    A row a,b,c,d,e,f,p is written for each map, with the probabilities of the chaos game if the code has none. `meta`
    and colours are lost. A text that is JSON is read as such.
    """

    key, suffixes, several = "table", (".csv", ".txt", ".tsv", ".dat"), False

    def entries(self, data: bytes) -> list[Entry]:
        if not JSON.match(data):
            return super().entries(data)
        lists = Json()
        lists.order = self.order
        return lists.entries(data)

    def write(self, codes: Sequence[IFS]) -> bytes:
        return "".join(",".join(words) + "\n" for words in _numbers(only_one(codes, self.key))).encode()


@dataclass(frozen=True)
class _Block:
    """A code's text, read when it is asked for: the header before its braces, None without braces; what stands in them;
    and what stands before it, and after the last one, outside of entries."""

    header: str | None
    body: str
    before: str = ""

    @property
    def name(self) -> str | None:
        return plain((self.header or "").partition("(")[0]) or None

    def code(self, order: str | None, notes: Sequence[str]) -> Import:
        """The code, whose report ends with the notes. Raises `InputError` that begins with the entry's name."""
        try:
            if "(3D)" in (self.header or "").upper().replace(" ", ""):
                raise InputError("is a code in space (3D); only codes in the plane are read, of 6 or 7 numbers a map")
            outside, before = _words_and_comments(self.before, 0)
            lines, within = _words_and_comments(self.body, MOST_NUMBERS)
            if sum(map(len, lines)) > MOST_NUMBERS:
                raise InputError(f"has more than {MOST_NUMBERS} numbers; a code has from 1 to {MOST_MAPS} maps")
            rows, weights, found = maps_of(lines, order)
            said = list(notes)
            if order is not None or self.header is None:
                said.insert(0, f"columns are read as {' '.join(found)} of {MEANING}" + (
                    "" if order or found == BY_MATRICES else "; if they stand otherwise, say so, as in --order abecdf"))
            if outside:
                said.append(f"left out: what stands between entries, from {plain(outside[0][0], 40)!r} on")
            meta: dict[str, Any] = {} if self.name is None else {"name": self.name}
            comment = "\n".join(filter(None, before + within))
            if len(comment) > MOST_COMMENT:
                said.append(f"left out: comments after {MOST_COMMENT} characters")
            meta |= {"comment": comment[:MOST_COMMENT]} if comment else {}
            return code_of(rows, weights, meta, said)
        except InputError as error:
            what = "the table" if self.header is None else f"entry {plain(self.header, 40)!r}"
            raise InputError(f"{what}: {error}") from None


def _words_and_comments(text: str, most: int) -> tuple[list[list[str]], list[str]]:
    """The words of each line that has any, until they are more than `most`, and as many comments as are kept."""
    lines: list[list[str]] = []
    comments: list[str] = []
    left = most
    for found in PIECES.finditer(text):
        words, _, comment = found[0].replace(";", "#", 1).partition("#")
        if comment and len(comments) < MOST_COMMENT:
            comments.append(plain(comment, MOST_COMMENT))
        if left >= 0 and (line := words_of(words, left + 1)):
            left -= len(line)
            lines.append(line)
    return lines, comments


def _blocks(text: str) -> list[_Block]:
    """All entries but comments. Raises `InputError` if braces do not match, or on more codes than a file may have."""
    blocks: list[_Block] = []
    begun, header, start, named, ended = False, "", 0, 0, 0
    for found in PIECES.finditer(text):
        piece = found[0]
        if piece == "{" and begun:
            raise InputError(f"entry {plain(header, 40)!r} has a second '{{'; end each entry with '}}'")
        elif piece == "{":
            begun, header, start = True, header.strip(), found.end()
        elif piece == "}":
            if begun and header.lower() != "comment":
                blocks.append(_Block(header, text[start:found.start()], text[ended:named]))
                check_codes(len(blocks))
                ended = found.end()
            begun, header = False, ""
        elif not begun and piece.lstrip()[:1] not in ("", ";", "#"):
            header, named = piece, found.start()
    if begun:
        raise InputError(f"entry {plain(header, 40)!r} does not end; close it with '}}'")
    if blocks and text[ended:].strip():
        blocks[-1] = replaced(blocks[-1], before=f"{blocks[-1].before}\n{text[ended:]}")
    return blocks


def _written(code: IFS, taken: dict[str, int]) -> str:
    """The text of an entry, under a name that is not taken yet."""
    notes = [plain(line) for key in ("title", "source", "comment")
             for line in (code.meta[key].splitlines() if isinstance(code.meta.get(key), str) else [])]
    lines = [f"{_free_name(plain(code.meta.get('name')), taken)} {{", *(f"  ; {note}" for note in notes if note),
             *("  " + " ".join(words) for words in _numbers(code)), "}"]
    return "\n".join(lines) + "\n"


def _numbers(code: IFS) -> list[list[str]]:
    """Rows a b c d e f p as words."""
    rows = rows_of(replaced(code, probabilities=code.sampling_probabilities()))
    return [[f"{number:g}" if number.is_integer() else repr(number) for number in row] for row in rows]


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
