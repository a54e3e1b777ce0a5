"""What waits for a store that is away: written down before a fit needs it, and read again with care."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from tracking_helpers import AT_ONCE, Between, artifacts

from fractal_exp import InputError, tracking
from fractal_exp.cli.runs import MlflowRuns
from fractal_exp.runtime.checkpoint import Checkpoint, Snapshot
from fractal_exp.tracking.run import MlflowTracker


@pytest.fixture
def lost(uri, start, tmp_path):
    """A run whose store is away, and its folder of what is undelivered."""
    run_id = start().run_id
    away = Between(uri, {"log_batch", "log_artifact"}, lambda: True)
    run = MlflowTracker(away, run_id, tmp_path, patience=AT_ONCE)
    run.log({"train/loss": 0.5}, 1)
    run.artifact("notes.txt", "some")
    return run, tmp_path / f"undelivered-{run_id}"


def test_a_checkpoint_writes_down_what_is_on_its_way_before_it_counts(lost, tmp_path):
    run, folder = lost
    Checkpoint(tmp_path / "checkpoint", first=run.secure).save(Snapshot(1, {}))
    assert json.loads((folder / "run.json").read_text())["metrics"][0][:2] == ["train/loss", 0.5]
    assert (folder / "0-notes.txt").read_text() == "some" and (tmp_path / "checkpoint").exists()


def test_a_fit_outlives_a_store_that_is_away_beside_a_folder_that_cannot_be_written(lost, capsys):
    run, folder = lost
    folder.write_text("no folder")
    run.secure()
    run.finish()
    said = capsys.readouterr().err
    assert "a kill would lose it" in said and f"could not be written to {folder} either" in said


DAMAGED = {
    "half": "{", "a list": "[]", "empty": "{}",
    "uri": {"uri": 1}, "run": {"run_id": "other"}, "status": {"status": "RUNNING"},
    "metrics": {"metrics": {}}, "a metric": {"metrics": [["train/loss", "0.5", 1, 1]]},
    "NaN": {"metrics": [["train/loss", float("nan"), 1, 1]]}, "a short metric": {"metrics": [["train/loss", 0.5, 1]]},
    "a huge step": {"metrics": [["train/loss", 0.5, 1, 10**400]]},
    "a tag": {"tags": [["name", 1]]}, "files": {"files": None}, "a file": {"files": [{"name": "a"}]},
    "a path": {"files": [{"name": "a", "step": None, "file": "SECRET"}]},
    "a path above": {"files": [{"name": "a", "step": None, "file": "../secret"}]},
    "a link": {"files": [{"name": "a", "step": None, "file": "link"}]},
    "the folder": {"files": [{"name": "a", "step": None, "file": ".."}]},
    "no file": {"files": [{"name": "a", "step": None, "file": "1-gone"}]},
    "a name": {"files": [{"name": "../a", "step": None, "file": "0-notes.txt"}]},
}


@pytest.mark.parametrize("damage", DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_or_crafted_note_is_refused_in_one_line_and_nothing_is_sent(lost, uri, tmp_path, damage):
    run, folder = lost
    run.finish()
    (tmp_path / "secret").write_text("mine")
    (folder / "link").symlink_to(tmp_path / "secret")
    note = folder / "run.json"
    text = damage if isinstance(damage, str) else json.dumps({**json.loads(note.read_text()), **damage})
    note.write_text(text.replace("SECRET", str(tmp_path / "secret")))
    before = tracking.store.connect(uri).get_run(run.run_id).info.status
    for read in (lambda: tracking.deliver(tmp_path), lambda: tracking.deliver(tmp_path, uri),
                 lambda: tracking.start_run(uri, "study", "fit", folder=tmp_path, resume_run_id=run.run_id)):
        with pytest.raises(InputError, match=f"{note} (is|has) .*; move {folder} away") as error:
            read()
        assert "\n" not in str(error.value)
    assert tracking.store.connect(uri).get_run(run.run_id).info.status == before
    assert artifacts(uri, run.run_id) == set()


def test_a_sweep_sends_what_waits_to_its_own_store_only(lost, uri, tmp_path, capsys):
    run, folder = lost
    run.finish()
    note = folder / "run.json"
    own = note.read_text()
    note.write_text(json.dumps({**json.loads(own), "uri": "http://127.0.0.1:9"}))
    settings = {"sweep": {"run": "none"}, "output": str(Path(uri.removeprefix("sqlite:///")).parent), "study": "study"}
    job = SimpleNamespace(path=tmp_path)
    with pytest.raises(InputError, match="its run is not below this sweep's"):
        MlflowRuns().check_kept(job, settings)
    assert note.exists() and "waits for another store, http://127.0.0.1:9; send it with" in capsys.readouterr().err
    note.write_text(own)
    with pytest.raises(InputError, match="its run is not below this sweep's"):
        MlflowRuns().check_kept(job, settings)
    assert not folder.exists() and artifacts(uri, run.run_id) == {"notes.txt"}
