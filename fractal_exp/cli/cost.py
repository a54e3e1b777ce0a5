"""What a sweep is going to take, told before it starts: the first steps of a fit are tried, on a plain square."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import torch
from omegaconf import DictConfig

from ..errors import InputError
from ..methods.base import Method, Progress
from ..methods.chaotic.method import Chaotic
from ..methods.stepwise import Stepwise
from ..runtime import threads
from ..runtime.deadline import in_words
from . import configuration

ENOUGH = 1.0  # seconds that steps are watched for, after the first, which compiles


class _Seen(Exception):
    """Ends a fit that has been watched for long enough."""


def watched(method: Method, resolution: int, clock: Callable[[], float] = time.monotonic) -> float:
    """The seconds, by the clock, of a fit of so many pixels a side, from the share of it that is done in ENOUGH of
    them."""
    target = torch.zeros(resolution, resolution)
    target[resolution // 4:-resolution // 4, resolution // 4:-resolution // 4] = 1
    seen = [(clock(), 0.0)]

    def watch(progress: Progress) -> None:
        seen.append((clock(), progress.fraction))
        if seen[-1][0] - seen[1][0] > ENOUGH and seen[-1][1] > seen[1][1]:
            raise _Seen

    try:
        method.reconstruct(target, on_step=watch)
    except _Seen:
        del seen[0]
    return (seen[-1][0] - seen[0][0]) / (seen[-1][1] - seen[0][1])


def estimate(jobs: Mapping[str, tuple[int, DictConfig]], workers: int,
             watch: Callable[[Method, int], float] = watched) -> str:
    """What so many jobs of each method, so many at a time, will take, in words; methods of unknown length are named.
    watch: what tells the seconds of a fit of so many pixels a side."""
    each = {name: _seconds(config, workers, watch) for name, (_, config) in jobs.items()}
    known = {name: seconds for name, seconds in each.items() if seconds is not None}
    total = sum(jobs[name][0] * seconds for name, seconds in known.items()) / workers
    parts = " + ".join(f"{jobs[name][0]} × {in_words(seconds)}" for name, seconds in known.items())
    without = ", ".join(name for name in each if name not in known)
    return f"about {in_words(total)}: {parts}" + (f"; without {without}" if without else "") if known else ""


def _seconds(config: DictConfig, workers: int, watch: Callable[[Method, int], float]) -> float | None:
    """The limit of a fit, or what its first steps say; None if its length depends on the image."""
    if limit := config.method.get("seconds"):
        return float(limit)
    try:
        method = configuration.build(config.method)
        threads.use(config.threads or max(1, threads.available() // workers))
        known = isinstance(method, Chaotic | Stepwise) and not config.get("init")  # a search begins with another method
        return watch(method, config.resolution) if known else None
    except (InputError, RuntimeError):  # the fit itself will say it
        return None
