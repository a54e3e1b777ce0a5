"""Streaming reader for the XML of `.flame` files, without document types, entities or deep nesting."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat

from ...errors import InputError
from .base import check_codes, check_count, plain

DEEPEST = 64
MOST_ATTRIBUTES = 1000  # of an element; flam3 knows fewer than 400
ROOT = "flame"
COLOURING = {"palette", "color", "colors"}
IGNORED = {"edit"}  # the edit history, with its content


@dataclass
class Flame:
    """A `flame` element: attributes of itself, its maps and its final map, and any problem that prevents reading it."""

    attributes: dict[str, str]
    xforms: list[dict[str, str]] = field(default_factory=list)
    final: dict[str, str] | None = None
    problem: str | None = None

    @property
    def name(self) -> str | None:
        return plain(self.attributes.get("name")) or None


def flames(text: str) -> list[Flame]:
    """The flames of a file. Raises `InputError` if it is not XML, or XML that could do harm."""
    handler = _Handler()
    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler, parser.EndElementHandler = handler.start, handler.end
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
        elif name == ROOT:
            if self._flame_depth:
                raise InputError("a <flame> stands in another; put them beside each other")
            self._flame_depth = len(self._path)
            self.found.append(Flame(attributes))
            check_codes(len(self.found))
        elif self._flame_depth:
            _take(self.found[-1], self._path[self._flame_depth:], attributes)

    def end(self, name: str) -> None:
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
    elif not (len(path) == 1 and path[0] in COLOURING) and flame.problem is None:
        twice = "a second " if path == ["finalxform"] else ""
        flame.problem = (f"has {twice}<{plain(path[-1], 40)}>, which a code cannot hold; remove it, or write out the "
                         "maps that it stands for")
