"""Colours of codes found in coloured pictures: how far they are from the pictures' own, and that no shape is worse.

    python -m benchmarks.colour                      half an hour on one quiet core; needs matplotlib and scikit-image
    python -m benchmarks.colour fern_by_map dragon   some of the drawings
    python -m benchmarks.colour --record benchmarks/results/colour.jsonl --sheet docs/images/colour.png

Each drawing of `benchmarks.colour_drawings`, made by matplotlib or Pillow, is inverted twice with the same seed:
without and with colour. For both, F1 of the lit pixels and F1 within a pixel, on the whole canvas. With colour, the
mean CIEDE2000 difference on pixels that both light: as `invert` tells it, with the picture's own cover of a pixel; and
as drawn, where a pixel is as much covered as the code's points cover it, so that a thin or misplaced part counts too.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from skimage.color import deltaE_ciede2000, rgb2lab

from fractal_exp import Inversion, View, invert, render
from fractal_exp.images.painted import Painted
from fractal_exp.images.reading import read_target
from fractal_exp.rendering.colour import on_ground
from fractal_exp.rendering.zoom import rich_point

from . import record
from .colour_drawings import DRAWINGS

CLOSER = 6.0         # the zoom beside the whole on the sheet
PANEL, GAP = 360, 8  # pixels of a picture on the sheet, and between pictures


def measured(name: str, path: Path) -> tuple[dict[str, Any], Inversion]:
    """The figures of one drawing, and the code with colours."""
    figures: dict[str, Any] = {"drawing": name}
    for key, colour in (("plain", False), ("coloured", True)):
        started = time.perf_counter()
        found = invert(path, colour=colour)
        figures[key] = {"f1": found.likeness.f1, "f1_1px": found.likeness.f1_1px, "maps": len(found.code),
                        "seconds": round(time.perf_counter() - started, 1), "verdict": found.verdict.words}
    figures |= {"ciede2000": found.likeness.colour, "ciede2000_as_drawn": as_drawn(found, path),
                "code": found.code.to_json()}
    print(f"{name}: F1 within a pixel {figures['plain']['f1_1px']:.3f} without and "
          f"{figures['coloured']['f1_1px']:.3f} with colour, CIEDE2000 {figures['ciede2000']:.2f}, as drawn "
          f"{figures['ciede2000_as_drawn']:.2f}; {found.code.colours}", flush=True)
    return figures, found


def as_drawn(found: Inversion, path: Path) -> float:
    """The mean CIEDE2000 difference between the picture and the code's rendering on the picture's ground, over pixels
    of which both cover more than half."""
    seen = Painted.of(read_target(path, found.target.image.shape[-1]))
    image = render(found.code, resolution=len(seen.lit), mode="colour")
    shown = on_ground(image, tuple(seen.ground.tolist())).numpy()
    both = seen.lit & (image[..., 3].numpy() > 0.5)
    return float(np.mean(deltaE_ciede2000(rgb2lab(seen.seen[both]), rgb2lab(shown[both]))))


def row_of(found: Inversion, path: Path) -> np.ndarray:
    """The picture, the code's rendering, and a closer view of it, side by side: (PANEL,W,3) uint8."""
    seen = Painted.of(read_target(path, found.target.image.shape[-1]))
    ground = tuple(seen.ground.tolist())
    views = View(), View(rich_point(found.code, end_zoom=CLOSER), CLOSER)
    drawn = [on_ground(render(found.code, view, resolution=PANEL, mode="colour"), ground).numpy() for view in views]
    picture = Image.fromarray(np.rint(255 * seen.seen.clip(0, 1)).astype(np.uint8)).resize((PANEL, PANEL),
                                                                                         Image.Resampling.BOX)
    gap = np.full((PANEL, GAP, 3), 128, np.uint8)
    panels = [np.asarray(picture), *(np.rint(255 * each).astype(np.uint8) for each in drawn)]
    return np.hstack([panels[0], gap, panels[1], gap, panels[2]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drawings", nargs="*", metavar="DRAWING", help=f"of {', '.join(DRAWINGS)} (default: all)")
    parser.add_argument("--record", type=Path, help="file of records to add to")
    parser.add_argument("--sheet", type=Path, help="PNG to write: picture, rendering and a closer view, a row each")
    options = parser.parse_args()
    if unknown := set(options.drawings) - set(DRAWINGS):
        parser.error(f"there is no drawing {', '.join(sorted(unknown))}; there are {', '.join(DRAWINGS)}")
    rows, strips = [], []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.drawings or DRAWINGS:
            path = Path(folder) / f"{name}.png"
            DRAWINGS[name]().save(path)
            figures, found = measured(name, path)
            rows.append(figures)
            strips += [row_of(found, path), np.full((GAP, 3 * PANEL + 2 * GAP, 3), 128, np.uint8)]
    ratios = {"mean CIEDE2000": statistics.mean(row["ciede2000"] for row in rows),
              "largest CIEDE2000": max(row["ciede2000"] for row in rows),
              "least F1 with colour over F1 without": min(row["coloured"]["f1"] / row["plain"]["f1"] for row in rows)}
    print(ratios)
    if options.sheet:
        Image.fromarray(np.vstack(strips[:-1])).quantize(256).save(options.sheet, optimize=True)
    if options.record:
        record.append(options.record, "colour", {"drawings": rows}, ratios)


if __name__ == "__main__":
    main()
