"""A code as a widget of a notebook: its page, and the code in Python, which follow each other."""

from __future__ import annotations

import json
from typing import Any

from ..errors import InputError
from ..ifs.code import IFS, View
from ..rendering.sheets import portrait
from ..runtime.extras import need
from .page import FRAME_HEIGHT, STATIC, check, page

need("anywidget")

import anywidget  # noqa: E402  (where it is missing, the line above names the remedy)
import traitlets  # noqa: E402


def _checked(code: Any) -> IFS:
    if not isinstance(code, IFS):
        raise InputError(f"a widget shows an IFS, got {type(code).__name__}; IFS.load reads one from a file, and "
                         "IFS.from_json takes plain data")
    check(code)
    try:
        json.dumps(dict(code.meta), allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError("a widget sends the code's meta to the browser, so it must hold nothing but JSON (text, "
                         f"finite numbers, lists, mappings): {error}") from error
    return code


def _from_page(data: Any, widget: CodeWidget) -> IFS:
    """The code that a page has sent. A wrong one is logged, and the page is sent the present one again."""
    try:
        return _checked(IFS.from_json(data))
    except InputError as error:
        widget.log.warning("The page's code is refused: %s", error)
        widget.send_state("code")
        return widget.code


class CodeTrait(traitlets.TraitType[IFS, IFS]):
    """A trait that holds an `IFS` in Python, and its plain JSON on the way to a page and back."""

    info_text = "an IFS"

    def validate(self, obj: Any, value: Any) -> IFS:
        return _checked(value)


class CodeWidget(anywidget.AnyWidget):
    """The page of a code in a notebook. Its maps can be edited in the page and in Python.

    `code` is the `IFS` that the page shows. When its maps are edited there, `code` becomes another `IFS`, and functions
    given to `observe(function, "code")` are called. When `code` is set, the page shows it, and can undo that. Its view
    stays, unless the new code has another number of maps or lies elsewhere. `height` is the height of the page in
    pixels, and can be set too.

    view: what the page opens on, by default the whole attractor. Raises `InputError`, at the start and when `code` is
    set, on a code that is not contractive or has more than 1000 maps, and on meta that is no JSON; at the start also on
    a height that is no whole number above 0, and, as soon as this module is imported, without the extra `notebook`.
    """

    _esm = (STATIC / "widget.mjs").read_text("utf-8")
    _page = traitlets.Unicode().tag(sync=True)
    code = CodeTrait().tag(sync=True, to_json=lambda code, widget: code.to_json(), from_json=_from_page)
    height = traitlets.Int(FRAME_HEIGHT, min=1).tag(sync=True)

    def __init__(self, code: IFS, *, view: View | None = None, height: int = FRAME_HEIGHT) -> None:
        if type(height) is not int or height < 1:
            raise InputError(f"height must be a whole number of pixels above 0, got {height!r}")
        text = page(_checked(code), view=view, still=portrait(code), live=True)
        super().__init__(code=code, height=height, _page=text)
