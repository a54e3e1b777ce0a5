"""flam3's `.flame` files: XML with maps, a camera, a palette and colours."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ..code import IFS, View
from ..numbers import MOST_MAPS
from .base import CodeFormat, Entry, code_of, number_of, numbers_of, plain, text_of
from .colours import COLOURS, Palette
from .flame_xml import Flame, flames

SIZE = 1024                  # pixels per side of the written picture
FLIP = np.diag([1.0, -1.0])  # flam3's y points down
# Attributes of an xform that do not move points. All others are variations or their parameters.
HARMLESS = {"weight", "coefs", "post", "linear", "opacity", "plotmode", "chaos", "color", "color_speed", "symmetry",
            "var_color", "animate", "name"}
# Quality 48 (points per pixel) gives the picture that `render` draws; a higher one lights up rare points too.
LOOK = {"supersample": "2", "filter": "0.1", "filter_shape": "gaussian", "quality": "48", "background": "0 0 0",
        "brightness": "4", "gamma": "4", "gamma_threshold": "0.01", "vibrancy": "1", "estimator_radius": "0",
        "estimator_minimum": "0", "estimator_curve": "0.4", "palette_mode": "linear", "interpolation": "linear"}
# flam3 makes dense pixels brighter than their colour, up to white. In a code's own colours, none may be so bright.
OWN_LOOK = LOOK | {"brightness": "0.3", "gamma": "8", "gamma_threshold": "0.001"}
IDENTITY = "1 0 0 1 0 0"


class FlameFile(CodeFormat):
    """flam3's XML, read if all maps are affine, and written with weights, camera, palette and colours.

    The picture is the one that `flam3-render` draws. flam3's y axis points down, so maps are mirrored both ways. A map
    is its `coefs`, times the weight of `linear`, then `post`. An affine, invertible `finalxform` is conjugated into the
    maps. What no code can hold is refused by name: other variations, `symmetry`, xaos (`chaos`), hidden maps.

    Reading gives maps in the file's coordinates, and weights as probabilities. `meta` gets `name`, and `camera` with
    the center and zoom of a `View` on the file's window. Palette, colours, quality, camera rotation and edit history
    are lost.

    Writing keeps only `meta["name"]` of the notes. flam3's colour is a place on a palette, so a code's own colours are
    approximate, see `colours.Palette`. A code without colours gets a palette that tells its maps apart. A code without
    probabilities gets those of the chaos game. The camera shows the canvas [-1,1]², or a square around an attractor
    that does not fit into it.
    """

    key, suffixes, several = "flame", (".flame", ".flam3"), True

    def entries(self, data: bytes) -> list[Entry]:
        return [Entry(flame.name, lambda flame=flame: _code(flame)) for flame in flames(text_of(data))]

    def write(self, codes: Sequence[IFS]) -> bytes:
        from xml.etree import ElementTree  # it writes; what is read goes through flame_xml

        written = [_element(code, ElementTree) for code in codes]
        root = written[0] if len(written) == 1 else ElementTree.Element("flames")
        root.extend(written if len(written) > 1 else [])
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _code(flame: Flame) -> IFS:
    try:
        if flame.problem is not None:
            raise InputError(flame.problem)
        weights = [number_of(xform.get("weight", "0"), "a weight") for xform in flame.xforms]
        with np.errstate(over="ignore", invalid="ignore"):  # the code refuses values that are not finite
            affine = [_affine(xform, f"xform {i + 1}") for i, xform in enumerate(flame.xforms)]
            rows = [_row(*_through(flame.final, linear, offset)) for linear, offset in affine]
        return code_of(rows, weights or None, _meta(flame))
    except InputError as error:
        raise InputError(f"flame {reprlib.repr(flame.name)}: {error}" if flame.name else f"flame: {error}") from None


def _affine(xform: Mapping[str, str], what: str) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (2,2) and offset (2,) of an xform, y downwards. Raises `InputError` that names what is not affine."""
    for key in sorted(xform.keys() - HARMLESS):
        if not _is_zero(xform[key]):
            raise InputError(f"{what} has the variation or parameter {plain(key, 40)!r}; only 'linear' is affine and "
                             "read, so set the others to 0")
    if any(number_of(word, f"chaos of {what}") != 1 for word in xform.get("chaos", "").split(None, MOST_MAPS)):
        raise InputError(f"{what} has 'chaos' (xaos), which a code cannot hold; remove it")
    if _is_zero(xform.get("opacity", "1")) or xform.get("plotmode") == "off":
        raise InputError(f"{what} is invisible (opacity 0), which a code cannot hold; remove it or set its opacity")
    if "coefs" not in xform:
        raise InputError(f"{what} has no coefs; give it six numbers")
    linear, offset = _coefs(xform["coefs"], f"coefs of {what}")
    strength = number_of(xform.get("linear", "0"), f"linear of {what}")
    if strength == 0:
        raise InputError(f"{what} has no variation; add linear=\"1\"")
    outer, shift = _coefs(xform.get("post", IDENTITY), f"post of {what}")
    return strength * outer @ linear, strength * outer @ offset + shift


def _is_zero(text: str) -> bool:
    try:
        return number_of(text.strip(), "") == 0
    except InputError:
        return False


def _coefs(text: str, what: str) -> tuple[np.ndarray, np.ndarray]:
    """flam3 writes the columns of the matrix, then the offset: x' = a x + c y + e, y' = b x + d y + f."""
    a, b, c, d, e, f = numbers_of(text, 6, what)
    return np.array([[a, c], [b, d]]), np.array([e, f])


def _through(final: Mapping[str, str] | None, linear: np.ndarray, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The maps G f G⁻¹. Their attractor is the image of the attractor under the final map G."""
    if final is None:
        return linear, offset
    outer, shift = _affine(final, "finalxform")
    if abs(np.linalg.det(outer)) < 1e-12:
        raise InputError("finalxform flattens the picture, which a code cannot hold; remove it")
    matrix = outer @ linear @ np.linalg.inv(outer)
    return matrix, outer @ offset + shift - matrix @ shift


def _row(linear: np.ndarray, offset: np.ndarray) -> list[float]:
    return [*(FLIP @ linear @ FLIP).ravel().tolist(), *(FLIP @ offset).tolist()]


def _meta(flame: Flame) -> dict[str, Any]:
    """Name and camera. flam3's defaults give a camera that shows the canvas."""
    width, height = numbers_of(flame.attributes.get("size", "100 100"), 2, "size")
    x, y = numbers_of(flame.attributes.get("center", "0 0"), 2, "center")
    scale = number_of(flame.attributes.get("scale", "50"), "scale")
    magnified = number_of(flame.attributes.get("zoom", "0"), "zoom")
    if not (min(width, height) > 0 and scale > 0 and abs(magnified) < 100):
        raise InputError(f"the camera needs a size and a scale above 0 and a zoom below 100, got size {width:g} "
                         f"{height:g}, scale {scale:g}, zoom {magnified:g}")
    view = View((x, 0.0 - y), 2 * scale * 2**magnified / max(width, height))
    camera = {"center": list(view.center), "zoom": view.zoom}
    return {"name": flame.name, "camera": camera} if flame.name is not None else {"camera": camera}


def _element(code: IFS, tree: Any) -> Any:
    """A `flame` element of a contractive code."""
    view = camera_of(code)
    data = code.to_json()
    root = tree.Element("flame", {
        "version": "fractal-exp", "name": plain(code.meta.get("name")) or "code", "time": "0", "size": f"{SIZE} {SIZE}",
        "center": f"{view.center[0]:.9g} {0.0 - view.center[1]:.9g}", "scale": f"{SIZE / 2 * view.zoom:.9g}",
        "zoom": "0", "rotate": "0", **(LOOK if code.colours is None else OWN_LOOK)})
    probabilities = code.sampling_probabilities().tolist() if data["probabilities"] is None else data["probabilities"]
    palette = Palette.of(code)
    maps = zip(data["linear"], data["offset"], probabilities, palette.places, palette.speeds, strict=True)
    for ((a, b), (c, d)), (e, f), chance, place, speed in maps:
        numbers = (a, 0.0 - c, 0.0 - b, d, e, 0.0 - f)  # 0 - x is never minus zero
        tree.SubElement(root, "xform", {
            "weight": repr(chance), "color": f"{place:.6g}", "color_speed": f"{speed:.6g}", "opacity": "1",
            "linear": "1", "coefs": " ".join(map(repr, numbers))})
    entries = tree.SubElement(root, "palette", {"count": str(COLOURS), "format": "RGB"})
    colours = [bytes(colour).hex().upper() for colour in palette.rgb]
    entries.text = "\n" + "\n".join("".join(colours[i:i + 8]) for i in range(0, COLOURS, 8)) + "\n"
    return root


def camera_of(code: IFS) -> View:
    """The canvas; or, if the attractor does not fit into it, a square of which the attractor spans three quarters.

    Raises `InputError` if the code is not contractive.
    """
    from .. import attractor  # imports numba, which reading does not need

    x0, y0, x1, y1 = (float(side) for side in attractor.visible_box(code))
    if max(map(abs, (x0, y0, x1, y1))) <= 1:
        return View()
    half = max(x1 - x0, y1 - y0) / attractor.FRAME_SIDE
    center = ((x0 + x1) / 2, (y0 + y1) / 2)
    return View(center, 1 / half if half > 1e-5 * max(1.0, math.hypot(*center)) else 1.0)
