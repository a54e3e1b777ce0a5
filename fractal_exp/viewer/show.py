"""What a code shows of itself, as methods of `IFS`. What draws is imported at the call, since it needs numba."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..ifs.code import IFS, View
from ..runtime.files import write_atomically

if TYPE_CHECKING:
    from .widget import CodeWidget


def picture(code: IFS) -> bytes | None:
    """What a notebook shows: the attractor on its canvas, as PNG. None if the code is not contractive."""
    from ..rendering.sheets import portrait

    return portrait(code)


def framed_page(code: IFS) -> str | None:
    """What a notebook that may run scripts shows: a page for flying into the attractor, in its own frame. None if no
    page can be made of the code."""
    from .page import frame

    try:
        return frame(_page(code))
    except InputError:
        return None


def widget(code: IFS, *, view: View | None = None, height: int = 480) -> CodeWidget:
    """The page as a widget of a notebook: maps that are dragged in it change its `code`, and its `code` can be set.

    It opens on `view`, or on the whole attractor; height is in pixels. Raises `InputError` where `save_html` does,
    on meta that is no JSON, and without the extra `notebook`.
    """
    from .widget import CodeWidget

    return CodeWidget(code, view=view, height=height)


def save_html(code: IFS, path: str | Path, *, view: View | None = None,
              resolution: int | tuple[int, int] | None = None) -> Path:
    """Write a single, self-contained HTML file in which a browser flies into the attractor; return the absolute path.
    It opens on `view`, or on the whole attractor. The picture fills the window, or has the `resolution`, (height,
    width) or one number for both, at most 4096 pixels a side, and is scaled to fit.

    The page uses the code's own coordinates, so its views are views of `fractal_exp.render`. Raises `InputError`,
    before anything is written, on a name that does not end in .html, another resolution, or a code that is not
    contractive or has more than 1000 maps; and if the file cannot be written.
    """
    path = Path(path).absolute()
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"a page is written as HTML, got {path.name!r}; end the name in .html")
    write_atomically(path, _page(code, view, resolution))
    return path


def _page(code: IFS, view: View | None = None, resolution: int | tuple[int, int] | None = None) -> str:
    from .page import check, page

    check(code, resolution)  # before the picture is drawn
    return page(code, view=view, still=picture(code), resolution=resolution)
