"""flam3's `.flame` files: XML with maps, a camera, a palette and colours."""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ..code import IFS, View
from ..colours import Colours
from ..numbers import MOST_MAPS
from .base import CodeFormat, Entry, Import, check_count, code_of, number_of, numbers_of, plain, text_of
from .colours import COLOURS, SPEED, Palette, of_palette
from .flame_xml import Flame, flames

SIZE = 1024                  # pixels per side of the written picture
FLIP = np.diag([1.0, -1.0])  # flam3's y points down
MIRROR = np.diag([-1.0, 1.0])
IDENTITY = "1 0 0 1 0 0"
MOVING = {"weight", "coefs", "post", "linear", "linear3D", "chaos"}  # attributes of an xform that are read
COLOURED = {"color", "color_speed", "symmetry"}                      # and for its colour
IN_SPACE = {"yzCoefs", "zxCoefs", "yzPost", "zxPost"}
# Attributes that do not move points in the plane. All others with a number are variations or their parameters.
UNMOVING = {"opacity", "plotmode", "var_color", "animate", "name", "flatten", "zscale", "ztranslate", "pre_zscale",
            "pre_ztranslate", "material", "material_speed", *(f"mod_{what}{end}" for end in ("", "_speed") for what in (
                "gamma", "contrast", "saturation", "hue"))}
USUAL = {("plotmode", "draw"), *((key, one) for key in ("opacity", "animate", "var_color", "cam_zoom")
                                 for one in ("1", "1.0"))}
NUMERIC = re.compile(r"[+-]?(\.?\d\S*|nan|inf(inity)?)", re.IGNORECASE)
FRAMING = {"name", "size", "center", "scale", "zoom"}  # attributes of a flame that are read
# Quality 48 (points per pixel) gives the picture that `render` draws; a higher one lights up rare points too.
LOOK = {"supersample": "2", "filter": "0.1", "filter_shape": "gaussian", "quality": "48", "background": "0 0 0",
        "brightness": "4", "gamma": "4", "gamma_threshold": "0.01", "vibrancy": "1", "estimator_radius": "0",
        "estimator_minimum": "0", "estimator_curve": "0.4", "palette_mode": "linear", "interpolation": "linear"}
# flam3 makes dense pixels brighter than their colour, up to white. In a code's own colours, none may be so bright.
OWN_LOOK = LOOK | {"brightness": "0.3", "gamma": "8", "gamma_threshold": "0.001"}


class FlameFile(CodeFormat):
    """flam3's XML, read if all maps are affine, and written with weights, camera, palette and colours.

    The picture is the one that `flam3-render` draws. flam3's y axis points down, so maps are mirrored both ways. A map
    is its `coefs`, times the weights of `linear` and `linear3D`, then `post`. An affine, invertible `finalxform` is
    conjugated into the maps, and a `symmetry` is written out. What no code can hold is refused by name: other
    variations, xaos (`chaos`), hidden maps, maps in space. What moves no point is reported.

    Reading gives maps in the file's coordinates, and weights as probabilities. `meta` gets `name`, and `camera` with
    the center and zoom of a `View` on the file's window. A palette of two entries or more gives colours, see
    `colours.of_palette`. Quality, camera rotation and edit history are lost.

    Writing keeps only `meta["name"]` of the notes. flam3's colour is a place on a palette, so a code's own colours are
    approximate, see `colours.Palette`. A code without colours gets a palette that tells its maps apart. A code without
    probabilities gets those of the chaos game. The camera shows the canvas [-1,1]², or a square around an attractor
    that does not fit into it.
    """

    key, suffixes, several = "flame", (".flame", ".flam3"), True

    def entries(self, data: bytes) -> list[Entry]:
        text, notes = text_of(data)
        return [Entry(flame.name, lambda flame=flame: _code(flame, notes)) for flame in flames(text)]

    def write(self, codes: Sequence[IFS]) -> bytes:
        from xml.etree import ElementTree  # it writes; what is read goes through flame_xml

        written = [_element(code, ElementTree) for code in codes]
        root = written[0] if len(written) == 1 else ElementTree.Element("flames")
        root.extend(written if len(written) > 1 else [])
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _code(flame: Flame, notes: Sequence[str]) -> Import:
    """The code of a flame, whose report ends with the notes. Raises `InputError` that begins with the flame's name."""
    try:
        if flame.problem is not None:
            raise InputError(flame.problem)
        xforms = [(xform, f"xform {i}") for i, xform in enumerate(flame.xforms, 1)]
        weights = [max(0.0, number_of(xform.get("weight", "0"), f"weight of {what}")) for xform, what in xforms]
        with np.errstate(all="ignore"):  # the code refuses values that are not finite
            affine = [_affine(xform, what) for xform, what in xforms]
            turns, shares = _symmetry(flame.symmetry, sum(weights), len(affine))
            rows = [_row(*_through(flame.final, turn @ linear, turn @ offset))
                    for turn in turns for linear, offset in affine]
        weights = [float(share) * weight for share in shares for weight in weights]
        turned = [] if flame.symmetry is None else [
            f"symmetry {plain(flame.symmetry, 40)} is written out: {len(turns)} maps for each, of the same density"]
        colours, said = _colours(flame, np.array(weights))
        return code_of(rows, weights or None, _meta(flame), [*notes, *turned, *said, *_left_out(flame)], colours)
    except InputError as error:
        raise InputError(f"flame {reprlib.repr(flame.name)}: {error}" if flame.name else f"flame: {error}") from None


def _affine(xform: Mapping[str, str], what: str) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (2,2) and offset (2,) of an xform, y downwards. Raises `InputError` that names what is not affine."""
    for key in sorted(xform.keys() - MOVING - COLOURED - UNMOVING):
        if key in IN_SPACE:
            raise InputError(f"{what} moves points in space, by {key}; only maps in the plane are read")
        if NUMERIC.fullmatch(xform[key].strip()) and not _is_zero(xform[key]):
            raise InputError(f"{what} has the variation or parameter {plain(key, 40)!r}; only 'linear' is affine and "
                             "read, so set the others to 0")
    if any(number_of(word, f"chaos of {what}") != 1 for word in xform.get("chaos", "").split(None, MOST_MAPS)):
        raise InputError(f"{what} has 'chaos' (xaos), which a code cannot hold; remove it")
    if _is_zero(xform.get("opacity", "1")) or xform.get("plotmode") == "off":
        raise InputError(f"{what} is invisible (opacity 0), which a code cannot hold; remove it or set its opacity")
    if "coefs" not in xform:
        raise InputError(f"{what} has no coefs; give it six numbers")
    linear, offset = _coefs(xform["coefs"], f"coefs of {what}")
    strength = sum(number_of(xform.get(key, "0"), f"{key} of {what}") for key in ("linear", "linear3D"))
    if strength == 0:
        raise InputError(f"{what} has no variation; add linear=\"1\"")
    outer, shift = _coefs(xform.get("post", IDENTITY), f"post of {what}")
    return strength * outer @ linear, strength * outer @ offset + shift


def _symmetry(kind: str | None, weight: float, maps: int) -> tuple[np.ndarray, np.ndarray]:
    """The isometries (G,2,2) of a symmetry, and the share (G,) of each that multiplies the weights of the maps.

    To flam3, a kind n is n - 1 turns beside the maps, of weight 1 each, and -n the mirror at the y axis as well; weight
    is the sum of the others'. Between two maps, its chaos game takes any number of these. So f is followed by g as
    often as the sum of all powers of Q has g, where Q gives each isometry its probability r, and the maps g f have the
    same measure. The sum is the inverse of 1 - Q among multiples of the identity, the mirror M, the sum U of all turns
    and U M: (1 + r - r U - m M)(a + b M + c U + d U M) = 1, where m is r with a mirror, else 0.

    Raises `InputError` on a kind that is no whole number, that flam3 draws at random (0), or of too many maps.
    """
    if kind is None:
        return np.eye(2)[None], np.ones(1)
    number = number_of(kind.strip(), "the kind of symmetry")
    if number == 0 or number != round(number) or abs(number) > MOST_MAPS:
        raise InputError(f"the kind of symmetry must be a whole number other than 0, at most {MOST_MAPS}, got "
                         f"{plain(kind, 40)!r}; write 3 for three turns, -3 for turns and a mirror")
    turns, mirrored = round(abs(number)), number < 0
    check_count(turns * (1 + mirrored) * max(maps, 1))
    angles = 2 * np.pi * np.arange(turns) / turns
    matrices = np.stack([np.cos(angles), -np.sin(angles), np.sin(angles), np.cos(angles)], 1).reshape(-1, 2, 2)
    r = 1 / np.float64(weight + turns - 1 + mirrored)
    m, one, rest = r * mirrored, 1 + r, 1 + r - r * turns
    a, b = one / (one**2 - m**2), m / (one**2 - m**2)
    shares = np.full((2, turns), [[rest * a + m * b], [rest * b + m * a]]) * r / (rest**2 - m**2)
    shares[:, 0] += a, b
    return np.concatenate([matrices, matrices @ MIRROR])[:turns * (1 + mirrored)], r * shares[:1 + mirrored].ravel()


def _colours(flame: Flame, weights: np.ndarray) -> tuple[Colours | None, list[str]]:
    """The colours of a flame's maps, and what is to be said of them. weights (K N,): of the N maps in K images, which
    have the colours of the maps themselves."""
    why = "the file has no palette of two colours"
    if len(flame.palette) > 1:
        try:
            places, speeds = np.array([_dye(xform, i) for i, xform in enumerate(flame.xforms)]).T.clip(0, 1)
            if flame.final is not None:  # it colours what is shown, after all other maps
                place, speed = np.clip(_dye(flame.final, len(flame.xforms)), 0, 1)
                places = (1 - speed) * places + speed * place
            places, speeds = np.resize([places, speeds], (2, len(weights)))
            if (speeds * weights > 0).any():
                mixed = len(flame.palette) > 2 and bool((speeds < 1).any())
                return of_palette(flame.palette, places, speeds), [
                    "colours are mixed in red, green and blue between the maps, not along the palette"] * mixed
            why = "no map that is chosen has one"
        except InputError as error:
            why = str(error)
    return None, [f"left out: colours, as {why}"] * any(COLOURED & xform.keys() for xform in flame.xforms)


def _dye(xform: Mapping[str, str], index: int) -> tuple[float, float]:
    """The place on the palette of the colour of an xform with an index, and its speed. Raises `InputError`."""
    speed = (1 - number_of(xform["symmetry"].strip(), "a symmetry")) / 2 if "symmetry" in xform else SPEED
    return (number_of((xform.get("color", "").split(None, 1) or [str(index % 2)])[0], "a color"),
            number_of(xform["color_speed"].strip(), "a color_speed") if "color_speed" in xform else speed)


def _left_out(flame: Flame) -> list[str]:
    """What is to be said of attributes that are not read."""
    final = [] if flame.final is None else [flame.final]
    of_maps = _unused((pair for xform in flame.xforms + final for pair in xform.items()), MOVING | COLOURED)
    of_flame = _unused(flame.attributes.items(), FRAMING)
    camera = [key for key in of_flame if key.startswith(("rotate", "cam_"))]
    return [f"left out: {what} ({plain(', '.join(names), 300)})" for what, names in (
        ("the camera's turn and tilt, so that the plane is seen straight from above", camera),
        ("attributes of maps that do not move points", of_maps), ("elements", sorted(flame.left_out)),
        ("how the flame is drawn", sorted({*of_flame} - {*camera}))) if names]


def _unused(pairs: Iterable[tuple[str, str]], used: set[str]) -> list[str]:
    """The names of attributes that say something, sorted."""
    return sorted({key for key, value in set(pairs) - USUAL if key not in used and not _is_zero(value)})


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
