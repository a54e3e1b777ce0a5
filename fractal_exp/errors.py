"""The one kind of error that a user can correct."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """The input cannot be used. The message says what was expected, what was given, and the remedy.

    Command lines print it as one line; any other exception is a defect of this package and keeps its traceback.
    """


def did_you_mean(word: str, names: Iterable[str], most: int = 2) -> str:
    """"; did you mean 'fern'?" if some of the names are close to the word, else an empty string."""
    close = difflib.get_close_matches(word.lower(), list(names), n=most, cutoff=0.6)
    return f"; did you mean {' or '.join(map(repr, close))}?" if close else ""
