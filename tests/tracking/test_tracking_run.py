"""What a run records, how it ends, and how it goes on."""

import json
import os
import re

import numpy as np
import pandas as pd
import pytest
import torch
from PIL import Image
from tracking_helpers import Between, artifacts, get

from fractal_exp import InputError, tracking
from fractal_exp.tracking import store
from fractal_exp.tracking.run import MlflowTracker


def test_buffered_metrics_arrive_with_their_steps_in_few_calls(uri, start, tmp_path):
    run_id = start().run_id
    client = Between(uri)
    run = MlflowTracker(client, run_id, tmp_path)
    for step in range(3000):
        run.log({"train/loss": 1 / (step + 1), "train/rate": torch.tensor(0.5)}, step)
    run.finish()
    series = tracking.read_series(uri, run_id, "train/loss")
    assert series["step"].tolist() == list(range(3000))
    np.testing.assert_array_equal(series["value"], 1 / np.arange(1, 3001))
    assert len(tracking.read_series(uri, run_id, "train/rate")) == 3000
    sizes = [len(kwargs["metrics"]) for name, kwargs in client.calls if name == "log_batch"]
    assert sum(sizes) == 6000 and max(sizes) <= 1000 and len(sizes) <= 12
    assert get(uri, run_id).info.status == "FINISHED"


@pytest.mark.parametrize("name", ["loss (mean)", "a//b", "/a", "../a", "", "a/", "é(", "x" * 251])
def test_names_that_mlflow_refuses_are_input_errors(start, name):
    with start() as run:
        with pytest.raises(InputError, match="metric names are letters"):
            run.log({name: 1.0})
        with pytest.raises(InputError, match="artifact names are letters"):
            run.artifact(name, "text")
        with pytest.raises(InputError, match="image names are letters"):
            run.image(name, np.zeros((4, 4)), 0)


def test_images_come_back(uri, start):
    pixels = (np.arange(64).reshape(8, 8) / 63).astype(np.float32)
    with start() as run:
        run.image("preview", torch.from_numpy(pixels), 50)
        run.image("whole", pixels)
        run.image("zoom/4x", np.zeros((8, 8, 3), np.uint8))
    assert {"views/whole.png", "views/zoom"} == artifacts(uri, run.run_id, "views")
    with Image.open(store.database_path(uri).parent / "mlartifacts" / run.run_id / "artifacts/views/whole.png") as png:
        np.testing.assert_array_equal(np.asarray(png), np.rint(255 * pixels))
    previews = artifacts(uri, run.run_id, "images")
    assert any(re.match(r"images/preview\+step\+50\+.*\.png", name) for name in previews), previews


def test_tables_come_back_and_are_replaced_not_appended(uri, start):
    frame = pd.DataFrame({"view": ["whole", "a"], "zoom": [1.0, 1 / 3], "psnr": [20.1, np.inf]})
    with start() as run:
        run.table("per_view.json", frame.iloc[:1])
        run.table("per_view.json", frame)
        with pytest.raises(InputError, match="must end in .json"):
            run.table("per_view.csv", frame)
    back = tracking.read_table(uri, run.run_id, "per_view.json")
    pd.testing.assert_frame_equal(back, frame.replace(np.inf, np.nan))
    assert json.loads(get(uri, run.run_id).data.tags["mlflow.loggedArtifacts"]) == [
        {"path": "per_view.json", "type": "table"}]


def test_artifacts_come_back(uri, start, tmp_path):
    (tmp_path / "code.json").write_text("{}")
    with start() as run:
        run.artifact("code.json", tmp_path / "code.json")
        (tmp_path / "code.json").write_text("changed afterwards")
        run.artifact("notes/bytes.bin", b"\x00\x01")
    assert tracking.read_artifact(uri, run.run_id, "code.json") == b"{}"
    assert tracking.read_artifact(uri, run.run_id, "notes/bytes.bin") == b"\x00\x01"
    with pytest.raises(InputError, match=r"no artifact 'code.txt'.*\['code.json'\]"):
        tracking.read_artifact(uri, run.run_id, "code.txt")


def test_parameters_are_flattened_and_long_ones_become_files(uri, start):
    with start(params={"model": {"kind": "svd", "maps": 10}, "seed": None, "path": "x" * 6001}) as run:
        pass
    params = get(uri, run.run_id).data.params
    assert params.pop("path").startswith("6001 characters, sha256 ")
    assert params == {"model.kind": "svd", "model.maps": "10", "seed": "None"}
    assert tracking.read_artifact(uri, run.run_id, "params/path.txt") == b"x" * 6001


def test_standard_tags_and_nesting(uri, start):
    tags = tracking.standard_tags(variant="full", method="chaotic", target="fern", scale="smoke", backend="cpu",
                                  device="cpu", study="s1")
    with start("sweep") as parent, start("child", tags=tags, parent_run_id=parent.run_id) as child:
        pass
    kept = get(uri, child.run_id).data.tags
    assert kept["mlflow.parentRunId"] == parent.run_id
    assert tags.items() <= kept.items() and tags["perceptual"] == "none" and tags["study"] == "s1"
    assert kept["pid"] == str(os.getpid()) and kept["host"] and kept["process_start"] and kept["device_name"]
    assert re.fullmatch(r"\d+\.\d+.*", kept["version"])
    assert re.fullmatch(r"[0-9a-f]{40}(-dirty)?", kept.get("git_commit", "0" * 40))


# How a run ends

def test_leaving_by_exception_is_failed_with_its_traceback(uri, start):
    with pytest.raises(RuntimeError), start() as run:
        run.log({"train/loss": 1.0}, 3)
        raise RuntimeError("it broke\nin two lines")
    ended = get(uri, run.run_id)
    assert ended.info.status == "FAILED" and ended.data.tags["error"] == "RuntimeError: it broke"
    assert ended.data.metrics == {"train/loss": 1.0}
    assert b"raise RuntimeError(" in tracking.read_artifact(uri, run.run_id, "traceback.txt")


# Going on

def test_resuming_keeps_the_run_and_logs_nothing_twice(uri, start):
    params = {"rate": 0.1}
    with pytest.raises(KeyboardInterrupt), start(params=params) as run:
        for step in range(5):
            run.log({"train/loss": 1.0 / (step + 1)}, step)
        run.table("per_view.json", pd.DataFrame({"f1": [0.5]}))
        raise KeyboardInterrupt
    with start(params=params, resume_run_id=run.run_id) as again:
        reopened = get(uri, run.run_id)
        assert reopened.info.status == "RUNNING" and "error" not in reopened.data.tags
        for step in range(3, 8):  # from the checkpoint at step 3
            again.log({"train/loss": 1.0 / (step + 1)}, step)
        again.table("per_view.json", pd.DataFrame({"f1": [0.7]}))
    assert again.run_id == run.run_id and get(uri, run.run_id).info.status == "FINISHED"
    assert tracking.read_series(uri, run.run_id, "train/loss")["step"].tolist() == list(range(8))
    assert tracking.read_table(uri, run.run_id, "per_view.json")["f1"].tolist() == [0.7]


def test_resuming_with_another_parameter_or_a_run_that_is_gone_is_an_input_error(uri, start):
    with start(params={"rate": 0.1}) as run:
        pass
    with pytest.raises(InputError, match="started with rate=0.1 and cannot go on with rate=0.2"):
        start(params={"rate": 0.2}, resume_run_id=run.run_id)
    store.connect(uri).delete_run(run.run_id)
    with pytest.raises(InputError, match="was deleted; restore it with"):
        start(resume_run_id=run.run_id)
    with pytest.raises(InputError, match="has no run 0123abc to resume"):
        start(resume_run_id="0123abc")


def test_no_tracker_takes_the_same_calls(tmp_path):
    with tracking.Tracker() as run:
        run.log({"train/loss": 1.0}, 3)
        run.image("preview", np.zeros((4, 4)), 3)
        run.image("whole", np.zeros((4, 4)))
        run.artifact("code.json", "{}")
        run.table("per_view.json", pd.DataFrame())
    run.finish("FAILED", "error")
    assert run.run_id is None
    with pytest.raises(RuntimeError), tracking.Tracker():
        raise RuntimeError
    assert issubclass(MlflowTracker, tracking.Tracker)
