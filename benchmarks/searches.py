"""Collage search as the benchmarks run it: with a limit of a core's seconds, and from where it is told to begin."""

from __future__ import annotations

import time
from dataclasses import dataclass

from fractal_exp.methods.base import AnyTarget
from fractal_exp.methods.collage.method import Collage
from fractal_exp.runtime.checkpoint import Snapshot
from fractal_exp.runtime.deadline import Deadline


class CoreTime(Collage):
    """Collage search whose limit counts the seconds that a core has worked."""

    def deadline(self, target: AnyTarget) -> Deadline:
        return Deadline(self.seconds, time.process_time, " of a core")


@dataclass(frozen=True)
class Given:
    """A checkpoint that a search goes on from, and that keeps nothing."""

    snapshot: Snapshot | None

    def load(self) -> Snapshot | None:
        return self.snapshot

    def save(self, snapshot: Snapshot) -> None:
        pass
