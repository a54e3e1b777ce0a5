"""One HTML file from a code: the page's script, style and numbers, under a policy that lets it load nothing."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from functools import cache
from importlib import resources
from string import Template
from typing import Any

import torch

from ..errors import InputError
from ..ifs import affine, attractor
from ..ifs.code import IFS, View
from ..rendering.tone import NOTE, own_tone
from ..runtime.checks import size_of
from .linking import linked

LARGEST = 200_000   # bytes of a page
MOST_MAPS = 1000    # of a code that is shown, in code.mjs too
MOST_SIDE = 4096    # pixels of a picture of a given size, which any WebGL 2 can draw into
LONGEST_TITLE = 120  # characters
FRAME_HEIGHT = 480  # pixels, in a notebook
EMPTY = "data:,"    # where there is no still picture
STATIC = resources.files("fractal_exp.viewer") / "static"


def page(code: IFS, *, view: View | None = None, still: bytes | None = None, live: bool = False,
         resolution: int | tuple[int, int] | None = None) -> str:
    """The text of an HTML file that shows a code's attractor at any depth, in a browser with WebGL 2.

    It opens on `view`, or on the whole attractor; its zoom counts from there. The code is shown in its own coordinates:
    a view of the page is one of `fractal_exp.render`. still: a PNG of the whole, which stands where a browser runs no
    script or has no WebGL 2; it is left out where the page would be too large. The file has at most 200 000 bytes, and
    its policy forbids it to load anything. Of the code's `meta` it takes the title, the name and the ground, as text,
    and the tone. A code with colours is shown in them on that ground, another with its tone; other colours can be
    chosen in the page. The maps can be edited in the page. live: the page exchanges codes with the window in whose
    frame it lies, a `CodeWidget`; others speak to nobody.

    As in `render`, 1/zoom is half of the picture's shorter side. The picture fills the window, or has a resolution,
    (height, width) or one number for both, of at most 4096 pixels a side, and is scaled to fit.

    Raises `InputError` on another resolution, and a code that is not contractive or has more than 1000 maps.
    """
    check(code, resolution)
    home = whole(code)
    title = _title(code)
    given = {"code": _packed(code), "title": title, "file": _file_name(title), "home": _plain(home),
             "view": _plain(view or home), "live": live,
             "size": None if resolution is None else size_of(resolution)[::-1]}
    script, style = _script(), _read("page.css")
    policy = (f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; img-src data: blob:; "
              "base-uri 'none'; form-action 'none'")
    poster = EMPTY if still is None else f"data:image/png;base64,{base64.b64encode(still).decode()}"
    parts = {"policy": html.escape(policy), "title": html.escape(title), "style": style, "script": script,
             "label": html.escape(f"The attractor of {title}"), "given": _embedded(given)}
    parts |= fragments()
    text = Template(_read("page.html")).substitute(parts, still=poster)
    if len(text.encode()) > LARGEST:
        text = Template(_read("page.html")).substitute(parts, still=EMPTY)
    return text


def fragments() -> dict[str, str]:
    """HTML that other pages with an editor need too, by name: the panel of the maps, and the dialogs of import and
    export. The ids in it are those that editor.mjs and the modules below it know."""
    return {name: _read(f"{name}.html") for name in ("panel", "exchange")}


def check(code: IFS, resolution: int | tuple[int, int] | None = None) -> None:
    """Raise `InputError` unless a page can show the code, at this resolution."""
    if resolution is not None and max(size_of(resolution)) > MOST_SIDE:
        raise InputError(f"the picture of a page has at most {MOST_SIDE} pixels a side, got resolution={resolution}; "
                         "fractal-render draws larger ones")
    if len(code) > MOST_MAPS:
        raise InputError(f"a page shows a code of at most {MOST_MAPS} maps, got {len(code)}; remove those of the least "
                         "probability")
    code.check_contractive()


def frame(text: str, height: int = FRAME_HEIGHT) -> str:
    """A page (its text) as an HTML element for a notebook: a frame that may run scripts and nothing else."""
    return (f'<iframe srcdoc="{html.escape(text)}" sandbox="allow-scripts" loading="lazy" title="A fractal to fly '
            f'into" style="width: 100%; height: {height}px; border: 0; border-radius: 8px"></iframe>')


def whole(code: IFS) -> View:
    """The view in which the longer side of the code's visible box spans three quarters: the canvas itself for a
    normalised code."""
    x0, y0, x1, y1 = (float(side) for side in attractor.visible_box(code))
    side = max(x1 - x0, y1 - y0)
    zoom = attractor.FRAME_SIDE / side if side > 1e-5 else 1.0
    center = (x0 + x1) / 2, (y0 + y1) / 2
    if abs(zoom - 1) < 1e-3 and max(map(abs, center)) < 1e-3:
        return View()
    return View(center, zoom)


def _plain(view: View) -> dict[str, float]:
    return {"x": view.center[0], "y": view.center[1], "zoom": view.zoom}


def _packed(code: IFS) -> dict[str, Any]:
    """What the page holds of a code: rows a b c d e f, probabilities and colours as float32 in base 64, and its notes
    on the title, the name, the ground of its colours and its tone.

    Written out, a thousand maps would be too long for a page.
    """
    own = code.probabilities
    colours = None if code.colours is None else {"rgb": _base64(code.colours.rgb),
                                                 "blends": _base64(code.colours.blends)}
    notes = {key: text for key in ("title", "name", "ground") if (text := _line(code.meta.get(key)))}
    tone = {NOTE: tone.facts()} if (tone := own_tone(code)) else {}
    return {"rows": _base64(affine.from_code(code)), "probabilities": None if own is None else _base64(own),
            "colours": colours, "meta": notes | tone}


def _base64(numbers: torch.Tensor) -> str:
    return base64.b64encode(numbers.cpu().numpy().astype("<f4").tobytes()).decode()


def _title(code: IFS) -> str:
    """The code's title or name in one line of text."""
    return (_line(code.meta.get("title")) or _line(code.meta.get("name"))
            or f"a code of {len(code)} map{'s' * (len(code) > 1)}")


def _line(given: Any) -> str:
    """A note in one line, cut where it is long; empty if it is no text."""
    text = " ".join(given.encode("utf-8", "replace").decode().split()) if isinstance(given, str) else ""
    return text if len(text) <= LONGEST_TITLE else text[:LONGEST_TITLE - 1] + "…"


def _file_name(title: str) -> str:
    """A file name without an ending, of plain letters."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:40] or "fractal"


def _embedded(data: Any) -> str:
    """JSON that may stand in a script element: no text in it can end that, or begin another."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


@cache
def _script() -> str:
    modules = {file.name.removesuffix(".mjs"): file.read_text("utf-8") for file in STATIC.iterdir()
               if file.name.endswith(".mjs")}
    return linked(modules, "main")


@cache
def _read(name: str) -> str:
    return (STATIC / name).read_text("utf-8")
