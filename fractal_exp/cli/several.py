"""The fits of `fractal-train -m` below one parent run, which holds their table."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig, open_dict, read_write

from ..errors import InputError
from ..runtime.files import make_folder
from .commands import complain
from .configuration import PARENT, build

if TYPE_CHECKING:
    from ..tracking import Tracker

_opened: list[Tracker] = []  # by Hydra's callback, which can return nothing


class OpenSeveral(Callback):
    """Hydra's call before the first fit: begins the parent run, and tells the fits of it."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        try:  # Hydra would make a mere warning of an error
            _opened.append(_parent(config))
        except InputError as error:
            complain("fractal-train", error)


def _parent(config: DictConfig) -> Tracker:
    from .jobs import job_name
    from .runs import NoRuns

    words = list(config.hydra.overrides.task)
    name = job_name(words, _swept(words))
    same = hashlib.sha256(json.dumps(sorted(word for word in words if not word.startswith("resume="))).encode())
    with read_write(config):
        config.output = str(Path(config.output).expanduser().absolute())
    settings = {key: config[key] for key in ("output", "study", "scale", "device", "resume")}
    runs: NoRuns = build(config.tracking)
    folder = make_folder(Path(config.output) / config.study / f"{name}-{same.hexdigest()[:6]}")
    run = runs.start_several(settings, folder, name, words)
    if run.run_id:
        with read_write(config), open_dict(config):
            config.hydra.overrides.task.append(f"{PARENT}={run.run_id}")
    return run


def _swept(words: Sequence[str]) -> set[str]:
    """The keys that have several values."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    parsed = OverridesParser.create().parse_overrides(list(words))
    return {each.get_key_element() for each in parsed if each.is_sweep_override()}


def close(scored: Sequence[tuple[str, Mapping[str, float]]], failed: Sequence[str], status: int) -> None:
    """End the parent run, if one was begun, with the table of the scores."""
    while _opened:
        run = _opened.pop()
        if scored:
            import pandas as pd

            run.table("summary.json", pd.DataFrame([{"fit": words, **scores} for words, scores in scored]))
        error = f"{len(failed)} fits failed" if failed else None
        run.finish("KILLED" if status == 130 else "FAILED" if error or status else "FINISHED", error)

