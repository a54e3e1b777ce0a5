"""The files of a result, the same with the same names from every command."""

from __future__ import annotations

from pathlib import Path

from ..images.pixels import write_image
from ..rendering.still import REUSE
from ..rendering.tone import usual_mode
from ..viewer.page import MOST_MAPS
from .result import CODE, INVERSION, TARGET, Inversion

REDRAWN, RENDERING, OVERLAY, PAGE = "redrawn.png", "rendering.png", "overlay.png", "code.html"
ANSWERS = "answers.png"
SIDE = 1024             # pixels, of the rendering
LARGEST_OVERLAY = 4096  # pixels of the picture's longer side


def write(found: Inversion, folder: Path) -> list[str]:
    """Write a result into a folder, and return the names of the files.

    code.json, the code alone; inversion.json, the code and all that is known of it; target.png, the picture as the
    method saw it; redrawn.png, the code drawn like the picture, and rendering.png, the code alone, both in colour if it
    has any, and else with its tone; code.html, a page, unless the code is too large for one; overlay.png, the picture
    with the differences marked, unless it has more than 4096 px a side; and answers.png, codes of few and of many maps,
    if several were grown. Raises `InputError` if a file cannot be written.
    """
    found.save(folder)
    found.render(resolution=SIDE, mode=usual_mode(found.code), reuse=REUSE, path=folder / RENDERING)
    write_image(folder / REDRAWN, found.redrawn(colour=found.code.colours is not None))
    names = [CODE, INVERSION, TARGET, REDRAWN, RENDERING]
    if len(found.code) <= MOST_MAPS:
        found.code.save_html(folder / PAGE)
        names.append(PAGE)
    if max(found.placement.size) <= LARGEST_OVERLAY:
        found.overlay(folder / OVERLAY)
        names.append(OVERLAY)
    if len(found.curve) > 1:
        found.answers(folder / ANSWERS)
        names.append(ANSWERS)
    return names
