"""A sweep as the command keeps it, without its fits."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from fractal_exp import tracking


def keep_sweep(uri: str, folder: Path, name: str, jobs: list[str], fit: Callable[[tracking.Tracker, str, str], None],
               study: str = "study", baseline: str | None = None, published: str | None = None,
               planned: tuple[str, ...] = (), **tags: str) -> None:
    """A sweep of these jobs, 'number,row' each: `fit` is called with the run, the number and the row of each.
    planned: jobs that never begin."""
    tags = {"kind": "sweep", "sweep": name, "scale": "smoke", "perceptual": "none"} | tags
    with tracking.start_run(uri, study, name, folder=folder, tags=tags) as parent:
        parent.artifact("jobs.json", json.dumps([*jobs, *planned]))
        parent.artifact("sweep.json", json.dumps({"title": "A study", "baseline": baseline, "published": published}))
        for job in jobs:
            number, row = job.split(",")
            fit(tracking.start_run(uri, study, job, folder=folder, parent_run_id=parent.run_id, tags={
                "kind": "job", "job": job, "row": row, "sample": f"fractal {number}"}), number, row)
