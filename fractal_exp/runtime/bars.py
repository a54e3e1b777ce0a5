"""Bars of progress on the terminal."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tqdm import tqdm


def progress_bar(items: Iterable[Any] | None = None, **options: Any) -> tqdm:
    """A bar of tqdm, or items counted by one. A terminal that does not know its size, on which tqdm's own would be
    empty, is taken to have 80 columns and 24 lines; one that is resized is followed."""
    from tqdm import tqdm

    columns, lines = shutil.get_terminal_size()
    bar = tqdm(items, ncols=columns, nrows=lines, **options)
    bar.dynamic_ncols = lambda _: shutil.get_terminal_size()
    return bar
