"""Comparison strips and contact sheets, as RGB arrays."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor

from ..errors import InputError
from ..ifs import attractor
from ..ifs.code import IFS, View
from ..images.pixels import png
from .still import render_with_info
from .tone import own_tone

LEAST_FONT, LARGEST_FONT = 9, 40           # pixels high
GROUND, INK = (32, 32, 32), (210, 210, 210)   # of captions
GAP = 4                                    # pixels between pictures
SHADE = 40                                 # grey level of a silhouette
MISSING = np.array([1.0, 0.55, 0.1])       # orange: only in the target
EXTRA = np.array([0.2, 0.6, 1.0])          # blue: only in the result
LEGEND = "orange: missing, blue: too much"
COLUMNS = ("target", "result", LEGEND)
FULL = 0.5                                 # difference of grey levels from which a mark has its full opacity
FADED, LIFTED = 0.6, 0.2                   # contrast and darkest grey of a picture on which differences are marked


def difference(image: Tensor, truth: Tensor) -> np.ndarray:
    """Where an image (H,W) in [0,1] differs from the truth: (H,W,3), orange where it is darker, blue where brighter."""
    signed = (truth.double() - image.double()).numpy()[..., None]
    return np.maximum(signed, 0) * MISSING + np.maximum(-signed, 0) * EXTRA


def marked(picture: np.ndarray, image: Tensor, truth: Tensor, box: Sequence[float], opacity: float = 1.0) -> np.ndarray:
    """A picture (H,W,3) uint8 in faded greys, with the differences between an image (R,R) and the truth (R,R) marked as
    `difference` does, and a legend below: (H+L,W,3) uint8.

    box: (x0, y0, x1, y1), the part of the picture, in its pixels, that the image shows, and that may reach beyond it;
    opacity: of a full difference, in (0,1].
    """
    height, width = picture.shape[:2]
    (x0, y0, x1, y1), side = box, len(image)
    x_scale, y_scale = side / (x1 - x0), side / (y1 - y0)
    signed = np.asarray(Image.fromarray((truth.float() - image.float()).numpy()).transform(
        (width, height), Image.Transform.EXTENT,
        (-x0 * x_scale, -y0 * y_scale, (width - x0) * x_scale, (height - y0) * y_scale), Image.Resampling.BILINEAR))
    faded = LIFTED + FADED / 255 * np.asarray(Image.fromarray(picture).convert("L"), np.float32)
    cover = opacity * np.minimum(np.abs(signed) / FULL, 1)[..., None]
    colours = np.where(signed[..., None] > 0, MISSING, EXTRA)
    pixels = np.rint(255 * ((1 - cover) * faded[..., None] + cover * colours)).clip(0, 255).astype(np.uint8)
    return np.concatenate([pixels, _legend(width)])


def _legend(width: int) -> np.ndarray:
    """`LEGEND` as a strip (L,width,3) uint8."""
    text, font = fitted(LEGEND, width - 2 * GAP, font_of(max(LEAST_FONT, min(width // 24, LARGEST_FONT))))
    line = round(font.getbbox("Ag")[3]) + 2 * GAP
    strip = Image.new("RGB", (width, line), GROUND)
    ImageDraw.Draw(strip).text((GAP, line - GAP), text, fill=INK, font=font, anchor="ls")
    return np.asarray(strip)


def comparison_strip(images: Tensor, truth: Tensor, captions: Sequence[str], side: int = 320) -> np.ndarray:
    """Target | result | difference, one row for each pair of images (V,R,R): (H,W,3) uint8.

    captions: one line per row. Every picture is scaled to `side` pixels. Raises `InputError` if the numbers differ.
    """
    if images.shape != truth.shape or len(captions) != len(images):
        raise InputError(f"a strip needs as many results as targets and captions, got {tuple(images.shape)}, "
                         f"{tuple(truth.shape)} and {len(captions)}")
    cells, notes = [], []
    for image, target, caption in zip(images, truth, captions, strict=True):
        cells += [_grey(target), _grey(image), difference(image, target)]
        notes += [f"{caption}: {COLUMNS[0]}", *COLUMNS[1:]]
    return _grid(cells, notes, columns=3, side=side)


def contact_sheet(images: Sequence[Tensor] | Tensor, captions: Sequence[str], columns: int = 10, side: int = 160
                  ) -> np.ndarray:
    """Small pictures of images (R,R) in rows of `columns`, with a caption below each: (H,W,3) uint8."""
    if len(images) != len(captions) or len(images) == 0:
        raise InputError(f"a contact sheet needs one caption an image, got {len(images)} images and {len(captions)}")
    return _grid([_grey(image) for image in images], captions, columns, side)


def _grey(image: Tensor) -> np.ndarray:
    return np.repeat(image.double().numpy()[..., None], 3, axis=-1)


def _grid(cells: Sequence[np.ndarray], captions: Sequence[str], columns: int, side: int) -> np.ndarray:
    font = font_of(max(LEAST_FONT, side // 24))
    line = round(font.getbbox("Ag")[3]) + GAP
    rows, columns = -(-len(cells) // columns), min(columns, len(cells))
    sheet = Image.new("RGB", (columns * (side + GAP) + GAP, rows * (side + line + GAP) + GAP), GROUND)
    pen = ImageDraw.Draw(sheet)
    for k, (cell, caption) in enumerate(zip(cells, captions, strict=True)):
        x, y = GAP + k % columns * (side + GAP), GAP + k // columns * (side + line + GAP)
        picture = Image.fromarray(np.rint(255 * np.clip(cell, 0, 1)).astype(np.uint8))
        sheet.paste(scaled(picture, side), (x, y))
        text, fitting = fitted(caption, side, font)
        pen.text((x, y + side + line - GAP), text, fill=INK, font=fitting, anchor="ls")
    return np.asarray(sheet)


def scaled(picture: Image.Image, side: int) -> Image.Image:
    """A square picture at this side: averaging over a pixel's area keeps thin shapes, and enlarging keeps pixels
    visible as pixels."""
    smaller = picture.width >= side
    return picture.resize((side, side), Image.Resampling.BOX if smaller else Image.Resampling.NEAREST)


def font_of(size: int) -> ImageFont.FreeTypeFont:
    """The font of captions. Raises `InputError` if this Pillow has none."""
    font = ImageFont.load_default(size=size)
    if not isinstance(font, ImageFont.FreeTypeFont):
        raise InputError("this Pillow has no FreeType to write captions with; pip install --force-reinstall pillow")
    return font


def fitted(caption: str, width: int, font: ImageFont.FreeTypeFont) -> tuple[str, ImageFont.FreeTypeFont]:
    """A caption at most as wide as its picture: in a smaller font, or else without its middle."""
    caption = " ".join(caption.split())
    while font.getlength(caption) > width and font.size > LEAST_FONT:
        font = font.font_variant(size=font.size - 1)
    kept = len(caption)
    text = caption
    while font.getlength(text) > width and kept > 0:
        kept -= 1
        text = caption[:(kept + 1) // 2].rstrip() + "…" + caption[len(caption) - kept // 2:].lstrip()
    return text, font


def portrait(code: IFS, side: int = 256) -> bytes | None:
    """The attractor of a code, brought to the canvas and drawn with its tone if it has one, as the bytes of a PNG; None
    if the code is not contractive."""
    try:
        framed = attractor.normalize(code)
    except InputError:
        return None
    return png(render_with_info(framed, resolution=side, mode="tone" if own_tone(code) else "occupancy")[0])


def silhouette(code: IFS, view: View, side: int) -> bytes:
    """A view of a code as the bytes of a PNG: dark grey, with the covered share of a pixel as its opacity."""
    image = render_with_info(code, view, resolution=side)[0]
    opacity = np.rint(255 * image.numpy()).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(np.dstack([np.full_like(opacity, SHADE), opacity]), "LA").save(file, format="PNG")
    return file.getvalue()
