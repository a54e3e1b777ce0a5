"""Where the time of collage search goes: shares of its stages and of its kernels, over all kinds of pictures.

    python -m benchmarks.search_shares --record benchmarks/results/search_shares.jsonl
    python -m benchmarks.search_shares --sets suite trees --count 4

One thread, one search after another: the last `--count` pictures of sets of `benchmarks.ablation`, with their limits,
and of its suite at 256². In each set, a search before them is not counted, since it compiles kernels. Seconds are by
the clock, and the profiler makes Python's part a little longer than it is. How far the kernels are from their floors,
`benchmarks.search_steps` tells.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

from fractal_exp.methods.base import AnyTarget, CodeReconstruction
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.history import History
from fractal_exp.runtime import threads

from . import record
from .ablation import SEED, SETS, Drawn, Grey

COUNT = 4
KINDS: dict[str, Grey | Drawn] = {"suite": Grey(SEED, 30, 256), **{
    name: SETS[name] for name in ("binary", "textbook_redrawn", "trees", "tone_curves")}}
# What takes time, by the file of a function and its name; the first that fits
PARTS = (("descents of maps", "ops/collage/cpu_kernels.py", "descend"),
         ("measures of orbits and images", "ops/collage/cpu_kernels.py", ""),
         ("renderings", "ops/histogram/", ""), ("renderings", "ifs/address_tree.py", ""),
         ("tiles and strokes", "cameras/tile_kernels.py", ""), ("tiles and strokes", "cameras/stroke_kernels.py", ""),
         ("other kernels", "ops/", ""), ("torch", "torch/", ""))
REST = "Python and NumPy"


def part_of(file: str, function: str) -> str:
    """The part of PARTS that a function of the profile belongs to."""
    if file == "~":   # built in
        return "torch" if "torch" in function or "TensorBase" in function else REST
    return next((part for part, path, name in PARTS if path in file and name in function), REST)


def shares(seconds: Mapping[str, float]) -> dict[str, float]:
    """The largest first."""
    total = sum(seconds.values())
    return {name: seconds[name] / total for name in sorted(seconds, key=seconds.__getitem__, reverse=True)}


class Watched:
    """Searches as they are watched: `parts` and `stages` have their seconds so far."""

    def __init__(self) -> None:
        self.parts, self.stages = defaultdict[str, float](float), defaultdict[str, float](float)
        self.searches, self.search = 0, Collage.reconstruct

    def reconstruct(self, method: Collage, target: AnyTarget, *, on_step: Any = None, checkpoint: Any = None
                    ) -> CodeReconstruction:
        """In the place of `Collage.reconstruct`."""
        history, profile = History([] if on_step is None else [on_step]), cProfile.Profile()
        found = profile.runcall(self.search, method, target, on_step=history, checkpoint=checkpoint)
        times: Any = pstats.Stats(profile)
        for (file, _, function), (_, _, alone, *_) in times.stats.items():
            self.parts[part_of(file, function)] += alone
        for stage in history.stages():
            self.stages[stage.name] += stage.seconds
        self.searches += 1
        return found


def measured(name: str, count: int, options: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The shares of a set: seconds of a search on average, and the shares of parts and stages, largest first. options:
    of the search."""
    watched, chosen = Watched(), KINDS[name]
    chosen.fit(chosen.targets()[0], dict(options or {}))

    def reconstruct(method: Collage, target: AnyTarget, **options: Any) -> CodeReconstruction:
        return watched.reconstruct(method, target, **options)

    with patch.object(Collage, "reconstruct", reconstruct):
        for target in chosen.targets()[-count:]:
            chosen.fit(target, dict(options or {}))
    return {"set": name, "searches": watched.searches, "seconds": sum(watched.parts.values()) / watched.searches,
            "parts": shares(watched.parts), "stages": shares(watched.stages)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--count", type=int, default=COUNT, help=f"searches of each set (default: {COUNT})")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    options = parser.parse_args()
    threads.use(1)
    rows = [measured(name, options.count) for name in options.sets]
    for row in rows:
        print(f"{row['set']}: {row['searches']} searches of {row['seconds']:.1f} s on average")
        for kind in ("parts", "stages"):
            print("  " + ", ".join(f"{name} {share:.0%}" for name, share in row[kind].items()))
    if options.record:
        record.append(options.record, "search_shares", {"sets": rows}, {})


if __name__ == "__main__":
    main()
