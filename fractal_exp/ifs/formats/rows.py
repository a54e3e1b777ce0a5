"""Rows of numbers in a text: its words, its maps, and the order in which the numbers of a map stand."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Sequence

from ...errors import InputError
from .base import check_count, number_of

USUAL = "abcdefp"         # x' = a x + b y + e, y' = c x + d y + f, chosen with the probability p
BY_MATRICES = "abecdfp"   # the rows of two matrices (N,3), as in the files of Princeton's course
HEADINGS = {letter: letter for letter in USUAL} | dict.fromkeys(("prob", "probability", "weight"), "p")
IN_3D = 13                # numbers of a map in space
SPACED = re.compile(r"[^\s,]\s+[^\s,]")  # two words without a comma between them


def check_order(order: str) -> str:
    """An order of columns as its seven letters, of which p may be left out at the end. Raises `InputError`."""
    letters = order.lower() if isinstance(order, str) else ""
    letters += "" if "p" in letters else "p"
    if sorted(letters) != sorted(USUAL):
        raise InputError("an order of columns names a, b, c, d, e and f once each, and p where the rows have "
                         f"probabilities, such as abcdefp or abecdf; got {reprlib.repr(order)}")
    return letters


def places_of(order: str, width: int) -> list[int]:
    """Where a b c d e f, and p in rows of seven numbers, stand in a row. Raises `InputError` if the order is of seven
    columns and the rows have six."""
    if width < len(order) and order[-1] != "p":
        raise InputError(f"the order {order} has seven columns, and the rows have six numbers; leave p out")
    return [order.index(letter) for letter in USUAL[:width]]


def words_of(text: str, most: int) -> list[str]:
    """The words of a line, up to `most` and the rest in one. Commas part them unless spaces alone do so somewhere: then
    a comma inside a word stays there, and the decimal comma of 0,5 is not taken for two numbers."""
    if SPACED.search(text) is None:
        return text.replace(",", " ").split(None, most)
    return [word for word in (word.strip(",") for word in text.split(None, most)) if word]


def maps_of(lines: Sequence[list[str]], order: str | None) -> tuple[list[list[float]], list[float] | None, str]:
    """Rows a b c d e f, their weights or None, and the order of columns, from the words of each line.

    A map is a line, or seven numbers across lines. A first line may name the columns or count the maps. Two matrices
    below a count and the probabilities are understood too. order: of the columns, whatever the first line says. Raises
    `InputError` that names the number and the map, counted from 1.
    """
    heading = _heading(lines[0]) if lines else None
    lines = _uncounted(lines[heading is not None:])
    flat = [word for line in lines for word in line]
    matrices = _by_matrices(flat)
    widths = {len(line) for line in lines}
    flat, width = (flat, 6 if widths == {6} else 7) if matrices is None else (matrices, 7)
    if widths == {IN_3D}:
        raise InputError("has 13 numbers a map, as codes in space do; only codes in the plane are read")
    numbers = [number_of(word, f"number {i % width + 1} of map {i // width + 1}") for i, word in enumerate(flat)]
    if not flat or len(flat) % width or widths == {1}:
        raise InputError(f"has {len(flat)} numbers; a map is a line of 6, a b c d e f, or of 7 with its probability, "
                         "the same for all maps")
    check_count(len(flat) // width)
    order = order or heading or (USUAL if matrices is None else BY_MATRICES)
    places = places_of(order, width)
    rows = [[numbers[i + place] for place in places] for i in range(0, len(numbers), width)]
    return [row[:6] for row in rows], [row[6] for row in rows] if width == 7 else None, order[:width]


def _heading(words: Sequence[str]) -> str | None:
    """The order of columns if a line names them."""
    letters = [HEADINGS.get(word.strip("\"'").lower(), "") for word in words[:8]]
    return check_order("".join(letters)) if letters and all(letters) else None


def _uncounted(lines: Sequence[list[str]]) -> Sequence[list[str]]:
    """The lines without a first one that counts the rows below it. Raises `InputError` if it counts wrongly."""
    if not lines or len(lines[0]) != 1 or {len(line) for line in lines[1:]} not in ({6}, {7}):
        return lines
    if lines[0][0].lstrip("0") != str(len(lines) - 1):
        raise InputError(f"the first line is {reprlib.repr(lines[0][0])}, and {len(lines) - 1} maps follow; correct "
                         "it, or leave it out")
    return lines[1:]


def _by_matrices(flat: Sequence[str]) -> list[str] | None:
    """The words in rows, if they are those of two matrices: n, n probabilities, and twice the words n and 3 and n
    rows."""
    count = (len(flat) - 5) // 7
    if count < 1 or len(flat) != 7 * count + 5:
        return None
    marks = [flat[i] for i in (0, count + 1, count + 2, 4 * count + 3, 4 * count + 4)]
    if marks != [str(count), str(count), "3", str(count), "3"]:
        return None
    x, y = flat[count + 3:4 * count + 3], flat[4 * count + 5:]
    return [word for i in range(count) for word in (*x[3 * i:3 * i + 3], *y[3 * i:3 * i + 3], flat[1 + i])]
