"""Streaming reader for the XML of `.flame` files, without document types, entities or deep nesting."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat

from ...errors import InputError
from .base import NUMBER, check_codes, check_count, plain
from .colours import COLOURS

DEEPEST = 64
MOST_ATTRIBUTES = 1000  # of an element; flam3 knows fewer than 400
ROOT = "flame"
LONGEST_PALETTE = 10_000  # characters; 256 colours take a fifth of it
HEX = re.compile(r"([0-9A-Fa-f]{2})*")
IGNORED = {"edit"}  # the edit history, with its content


@dataclass
class Flame:
    """A `flame` element: attributes of itself, its maps and its final map; its kind of symmetry; entries of its palette
    by index, red, green and blue in [0,255]; elements that are left out; any problem that prevents reading it."""

    attributes: dict[str, str]
    xforms: list[dict[str, str]] = field(default_factory=list)
    final: dict[str, str] | None = None
    symmetry: str | None = None
    palette: dict[int, tuple[float, ...]] = field(default_factory=dict)
    left_out: set[str] = field(default_factory=set)
    problem: str | None = None

    @property
    def name(self) -> str | None:
        return plain(self.attributes.get("name")) or None


def flames(text: str) -> list[Flame]:
    """The flames of a file. Raises `InputError` if it is not XML, or XML that could do harm."""
    handler = _Handler()
    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler, parser.EndElementHandler = handler.start, handler.end
    parser.CharacterDataHandler = handler.text
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = _refuse_declaration
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        raise InputError(f"the file is not XML: {expat.ErrorString(error.code)} in line {error.lineno}, column "
                         f"{error.offset}") from None
    return handler.found


def _refuse_declaration(*_: Any) -> None:
    raise InputError("the file declares a document type or an entity, which could make it endless or fetch other "
                     "files; remove the declaration <!…>")


class _Handler:
    """Gathers flames as elements begin and end."""

    def __init__(self) -> None:
        self.found: list[Flame] = []
        self._path: list[str] = []
        self._flame_depth = 0    # of the flame around, 0 outside one
        self._ignored_depth = 0  # likewise of an element that is ignored
        self._palette: list[str] | None = None  # a palette's text so far, None outside one
        self._room = self._digits = 0           # characters of it that are still kept, and of each colour

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self._path.append(name)
        if len(self._path) > DEEPEST:
            raise InputError(f"the file's elements are nested more than {DEEPEST} deep; that is no flame")
        if self._ignored_depth:
            return
        if len(attributes) > MOST_ATTRIBUTES:
            raise InputError(f"<{plain(name, 40)}> has {len(attributes)} attributes; at most {MOST_ATTRIBUTES} are "
                             "read")
        if name in IGNORED:
            self._ignored_depth = len(self._path)
            if self._flame_depth:
                self.found[-1].left_out.add(name)
        elif name == ROOT:
            if self._flame_depth:
                raise InputError("a <flame> stands in another; put them beside each other")
            self._flame_depth = len(self._path)
            self.found.append(Flame(attributes))
            check_codes(len(self.found))
        elif self._flame_depth:
            path = self._path[self._flame_depth:]
            _take(self.found[-1], path, attributes)
            if path == ["palette"]:
                self._palette, self._room = [], LONGEST_PALETTE
                self._digits = 8 if attributes.get("format") == "RGBA" else 6

    def text(self, text: str) -> None:
        if self._palette is not None and self._room > 0:
            self._palette.append(text)
            self._room -= len(text)

    def end(self, name: str) -> None:
        if self._palette is not None and self._path[self._flame_depth:] == ["palette"]:
            _take_palette(self.found[-1], "".join(self._palette), self._digits, 0)
            self._palette = None
        if len(self._path) == self._flame_depth:
            self._flame_depth = 0
        if len(self._path) == self._ignored_depth:
            self._ignored_depth = 0
        self._path.pop()


def _take(flame: Flame, path: list[str], attributes: dict[str, str]) -> None:
    """Record an element inside a flame. path: the names of the elements around it, then its own."""
    if path == ["xform"]:
        flame.xforms.append(attributes)
        check_count(len(flame.xforms))
    elif path == ["finalxform"] and flame.final is None:
        flame.final = attributes
    elif path == ["symmetry"] and flame.symmetry is None:
        flame.symmetry = attributes.get("kind", "0")
    elif path == ["color"]:
        _take_colour(flame, attributes)
    elif path == ["colors"]:
        _take_palette(flame, attributes.get("data", ""), 8, 2)
    elif path != ["palette"] and flame.problem is None:
        twice = "a second " if path in (["finalxform"], ["symmetry"]) else ""
        flame.problem = (f"has {twice}<{plain(path[-1], 40)}>, which a code cannot hold; remove it, or write out the "
                         "maps that it stands for")


def _take_colour(flame: Flame, attributes: dict[str, str]) -> None:
    """Record one entry of a palette."""
    words = [attributes.get("index", ""), *attributes.get("rgb", "").split(None, 3)]
    if len(words) == 4 and all(map(NUMBER.fullmatch, words)) and float(words[0]) in range(COLOURS):
        flame.palette[int(float(words[0]))] = tuple(map(float, words[1:]))
    else:
        flame.left_out.add("color")


def _take_palette(flame: Flame, text: str, digits: int, skipped: int) -> None:
    """Record a palette of hexadecimal digits. digits: of each colour, whose red begins after those skipped."""
    letters = "".join(text[:LONGEST_PALETTE].split())
    if HEX.fullmatch(letters) and len(letters) % digits == 0 < len(letters) <= COLOURS * digits:
        for index, start in enumerate(range(skipped, len(letters), digits)):
            flame.palette[index] = tuple(bytes.fromhex(letters[start:start + 6]))
    else:
        flame.left_out.add("palette")
