"""What must not be mixed up: sweeps in one output folder, runs of two stores, values that come in during a sending."""

import threading
from pathlib import Path

import pytest
from hydra import compose, initialize_config_module

from fractal_exp.cli import configuration, sweeps
from fractal_exp.tracking.outbox import BATCH, Outbox


def folder(output: Path, *overrides: str) -> Path:
    """Of a sweep of two jobs, opened as Hydra opens it; no job is composed, nor tried for what it will take."""
    configuration.register()
    words = ["tracking=none", f"output={output}", "scale=smoke", "sweep.count=1", *overrides]
    with pytest.MonkeyPatch.context() as patch, initialize_config_module("fractal_exp.sweeps", version_base="1.3"):
        patch.setattr(sweeps, "planned", lambda config: ([["seed=0"], ["seed=1"]], ["seed"]))
        patch.setattr(sweeps, "_by_method", lambda *_: {})
        config = compose("seeds", ["hydra.searchpath=[pkg://fractal_exp.conf]", *words], return_hydra_config=True)
        sweep = sweeps.RunningSweep(config)
        sweep.watch.stop()
        return sweep.folder


def test_sweeps_that_score_or_fit_otherwise_have_folders_of_their_own(tmp_path):
    first = folder(tmp_path)
    others = [folder(tmp_path, change) for change in ("evaluation.resolution=48", "evaluation.align=none",
                                                      "resolution=128", "model.maps=3")]
    assert len({first, *others}) == 5
    assert folder(tmp_path, "threads=1", "checkpoint_every=3", "sweep.workers=2", "sweep.count=2") == first
    assert folder(tmp_path / "elsewhere").name == first.name


def test_what_comes_in_while_a_batch_is_sent_is_sent_with_the_next(tmp_path):
    class Client:
        tracking_uri = "sqlite:////nowhere.db"
        begun, values, tags = threading.Event(), [], {}

        def log_batch(self, run_id, metrics, tags):
            if not self.begun.is_set():
                outbox.metric("late", 1.0, 0, 0)
                outbox.tag("late", "yes")
                self.begun.set()
            self.values += [metric.key for metric in metrics]
            self.tags |= {tag.key: tag.value for tag in tags}

        def set_terminated(self, *_, **__):
            pass

    outbox = Outbox(Client(), "run", tmp_path, set(), set())
    for i in range(2 * BATCH + 500):
        outbox.metric("early", 1.0, 0, i)
    assert Client.begun.wait(60)
    outbox.close("FINISHED")
    assert sorted(Client.values) == ["early"] * (2 * BATCH + 500) + ["late"] and Client.tags == {"late": "yes"}
