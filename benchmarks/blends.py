"""What it gains, and takes, to find a blend for each map of a code instead of one for all.

    python -m benchmarks.blends --record benchmarks/results/blends.jsonl    about three minutes of a core

A coloured drawing of `benchmarks.colour_drawings` is drawn by more and more maps. Their colours are fitted with one
blend, where `invert(..., colour=True)` begins, and with a blend each, where it ends. Errors are the sums of squares
that are minimised; seconds are of one core.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

from fractal_exp import invert
from fractal_exp.colouring import fitting
from fractal_exp.images.painted import Painted
from fractal_exp.runtime import threads

from . import record
from .colour_drawings import DRAWINGS

MAPS = 8, 16, 32, 64, 128
SECONDS = 20  # of a search


def compared(path: Path, maps: int) -> dict[str, Any]:
    """The figures of one number of maps."""
    found = invert(path, maps=maps, seconds=SECONDS)
    sample = fitting.sampled(found.code, Painted.of(found.target), 0)
    assert sample is not None, "the drawing and its code share pixels"
    began = time.process_time()
    alike = min((fitting.alike(sample, blend) for blend in fitting.ALIKE), key=lambda fit: fit.cost)
    half = time.process_time()
    each = fitting.improved(sample, alike.x)
    return {"maps": len(found.code), "error, one blend": 2 * alike.cost, "error, a blend each": 2 * each.cost,
            "seconds, one blend": half - began, "seconds more, a blend each": time.process_time() - half}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drawing", nargs="?", default="compound_leaf", choices=DRAWINGS)
    parser.add_argument("--record", type=Path, help="file of records to add to")
    options = parser.parse_args()
    threads.use(1)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawing.png"
        DRAWINGS[options.drawing]().save(path)
        for maps in MAPS:
            rows.append(compared(path, maps))
            print(rows[-1], flush=True)
    if options.record:
        ratios = {f"{row['maps']} maps: error with a blend each over one": row["error, a blend each"]
                  / row["error, one blend"] for row in rows}
        record.append(options.record, "blends", {"drawing": options.drawing, "rows": rows}, ratios)


if __name__ == "__main__":
    main()
