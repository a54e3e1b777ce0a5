"""Sweeps as users meet them, at sizes that take moments: what they consist of, failure, and restarts after kills."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pandas as pd
import pytest
import yaml
from commands import said
from hydra.utils import instantiate
from places import ROOT
from processes import end_of, wait_for
from sweeps_helpers import jobs_of, run, start, stored

from fractal_exp import IFS, tracking
from fractal_exp.cli import sweep as command
from fractal_exp.cli.jobs import job_name
from fractal_exp.studies import report
from fractal_exp.studies.published import TABLES
from fractal_exp.tracking.store import is_alive

SWEEPS = ROOT / "sweeps"
NAMES = sorted(path.stem for path in SWEEPS.glob("*.yaml"))


@pytest.mark.parametrize("name", [
    name if name == "function_count" else pytest.param(name, marks=pytest.mark.slow) for name in NAMES])
def test_the_jobs_of_every_sweep_pass_their_schema_and_have_rows(name):
    jobs = jobs_of(name, f"sweep.count={2 if name == 'points' else 1}")
    labels = [(job["sweep"]["row"], job["sweep"]["sample"]) for job in jobs]
    assert len(labels) > 1 and len(set(labels)) == len(labels), "each job is one sample of one row"
    baseline = jobs[0]["sweep"]["baseline"]
    assert baseline is None or baseline in {row for row, _ in labels}


def test_the_ablations_are_the_papers_rows_in_its_order():
    jobs = jobs_of("ablations", "sweep.count=1", "scale=paper")
    assert [job["variant"] for job in jobs] == list(TABLES["ablations"].rows)


@pytest.mark.parametrize("name", ["written", "released"])
def test_the_ablations_of_a_preset_can_all_be_built(name):
    jobs = jobs_of("ablations", f"method=chaotic_{name}", "sweep.count=1", "target.index=0")
    rows = {job["variant"]: instantiate(job["method"]) for job in jobs}
    assert len(rows) == len(TABLES["ablations"].rows) and f"as_{name}" in rows
    assert all(method.result != "best" for method in rows.values()), "what a row does not name stays"


def test_the_ablations_of_a_preset_are_compared_with_it(tmp_path):
    status, printed = run(tmp_path, "ablations", "method=chaotic_released", "ablation=none,no_ssim", "sweep.count=2")
    assert status == 0, printed
    sweep, _ = stored(tmp_path, "ablations")
    assert sweep.baseline == "as_released"
    table = report.summary(sweep).set_index("row")
    assert table.loc["as_released+no_ssim", "compared"] == 2


def test_the_comparison_holds_every_method_there_is():
    methods = {path.stem for path in (SWEEPS.parent / "conf" / "method").glob("*.yaml")}
    jobs = jobs_of("comparisons", "sweep.count=1")
    assert {job["sweep"]["row"] for job in jobs} == methods - {"chaotic"}, "which is one of the three beside it"
    assert {job["sweep"]["row"]: job["preset"] for job in jobs if job["preset"]} == {
        "chaotic_written": "as_written", "chaotic_released": "as_released", "chaotic_ours": "ours"}
    assert all(job["seconds"] == job["method"]["seconds"] == 90 for job in jobs), "44 fits of 90 s are half an hour"


def test_what_the_released_defects_cost_is_shown_beside_the_sound_search_for_as_long_as_the_user_says():
    jobs = {job["sweep"]["row"]: job["method"] for job in jobs_of("as_released", "sweep.count=1", "seconds=7")}
    assert {row: (method["as_released"], method["seconds"]) for row, method in jobs.items()} == {
        f"{name}, as_released={odd}": (odd, 7) for odd in (False, True)
        for name in ("evolutionary", "cuckoo", "learning_fractals_32", "learning_fractals_256")}


def test_a_comparison_at_the_papers_scale_is_not_cut_off():
    jobs = jobs_of("as_released", "sweep.count=1", "scale=paper", "method=cuckoo")
    assert [job["method"]["seconds"] for job in jobs] == [None, None]


def test_names_of_jobs_say_what_varies_and_stay_apart():
    varies = ["target.index", "ablation"]
    assert job_name(["target.index=3", "ablation=naive", "seed=1"], varies) == "target.index=3,ablation=naive"
    long = [job_name([f"target.index={'9' * 300}{i}"], varies) for i in range(2)]
    odd = [job_name([f"target.index=a{c}b"], varies) for c in "/:"]
    assert len({*long, *odd}) == 4 and all(len(name) < 200 and "/" not in name for name in [*long, *odd])


def test_a_failing_job_is_shown_counted_and_stops_no_other(tmp_path):
    words = ["function_count", "sweep.count=1", "model.maps=0,3"]
    for again in (False, True):
        status, printed = run(tmp_path, *words)
        assert status == 1
        assert "Traceback" in printed and "the number of maps N must be at least 1, got 0" in printed
        assert "1 of 2 jobs finished; 1 failed" in printed and ("(finished before)" in printed) == again
        sweep, runs = stored(tmp_path, "function_count")
        assert list(sweep.jobs["status"]) == ["FAILED", "FINISHED"] and len(runs) == 3, "no duplicates"
        assert "must be at least 1" in sweep.jobs["reason"][0]
    folder = next((tmp_path / "function_count").glob("smoke-*"))
    assert {f"report.{kind}" for kind in ("md", "tex", "csv", "png")} <= {path.name for path in folder.iterdir()}
    assert "1 failed" in (folder / "report.md").read_text()
    parent = runs[runs["run_id"] == sweep.run_id].iloc[0]
    assert parent["status"] == "FAILED" and parent["tags.error"] == "1 jobs failed, 0 without a result"
    children = runs[runs["run_id"] != sweep.run_id]
    assert set(children["tags.mlflow.parentRunId"]) == {sweep.run_id}
    summary = tracking.read_table(f"sqlite:///{tmp_path / 'mlflow.db'}", sweep.run_id, "summary.json")
    assert list(summary["row"][:2]) == ["0 maps", "3 maps"]


@pytest.mark.slow
def test_a_sweep_killed_in_its_parts_comes_to_the_same_table(tmp_path):
    """Killed fits, workers without a sweep and killed runs have quick tests of their own."""
    alone = ["function_count", "sweep.count=2", "model.maps=3,5", "iterations=200", "checkpoint_every=5"]
    words = [*alone, "launch=joblib"]
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    status, printed = run(whole, *alone)
    assert status == 0 and "4 of 4 jobs finished" in printed

    def in_work() -> list[Path]:
        return [path.parent for path in killed.glob("function_count/*/*/checkpoint.safetensors")]

    process = start(killed, *words)
    job = wait_for(in_work, "waited for a checkpoint", process)[0]
    os.kill(int((job / ".lock").read_text()), signal.SIGKILL)
    printed, _ = end_of(process)
    assert process.returncode == 1 and "the same command again goes on" in printed, "a killed worker ends the sweep"
    assert "A worker process managed by the executor was unexpectedly terminated" in printed

    process = start(killed, *words)

    def children() -> list[int]:
        """The sweep's processes, once one of them works on the job again."""
        listed = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process.pid)], text=True, capture_output=True).stdout
        pids = [int(pid) for pid in listed.split()]
        return pids if int((job / ".lock").read_text() or 0) in pids else []

    workers = wait_for(children, "waited for a worker", process)
    process.send_signal(signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + 300
    while alive := [pid for pid in workers if is_alive(pid)]:
        assert time.monotonic() < deadline, f"{alive} outlive their parent"
        time.sleep(0.05)

    status, printed = run(killed, *words)
    assert status == 0 and "4 of 4 jobs finished" in printed
    (sweep, runs), (expected, _) = stored(killed, "function_count"), stored(whole, "function_count")
    assert set(runs["status"]) == {"FINISHED"} and len(runs) == 5, "a parent and four jobs"
    scores = ["job", "row", "sample", "status", *(f"metric.{name}" for name in sweep.metrics)]
    pd.testing.assert_frame_equal(sweep.jobs[scores], expected.jobs[scores])
    for path in sorted(whole.glob("function_count/*/*/code.json")):
        assert IFS.load(killed / path.relative_to(whole)).linear.equal(IFS.load(path).linear)


BAD = {
    "no study": ([], "name a study first: ablations"),
    "unknown study": (["abalations"], "no study 'abalations'; did you mean 'ablations'"),
    "nothing varies": (["ablations", "hydra.sweeper.params=null"], "nothing varies"),
    "unusable store": (["seeds", "output=/proc/nowhere"], "/proc/nowhere"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_in_one_line_before_any_work(name, tmp_path):
    words, message = BAD[name]
    output = [] if any(word.startswith("output=") for word in words) else [f"output={tmp_path / 'out'}"]
    assert message in said(command, *words, *output)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_study_of_ones_own_needs_only_what_varies(tmp_path):
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump({
        "defaults": ["sweep", {"override target": "known"}, "_self_"], "study": "mine",
        "sweep": {"title": "Mine", "row": "lr ${optimizer.lr}", "sample": "seed ${seed}"},
        "hydra": {"sweeper": {"params": {"optimizer.lr": "0.01,0.02"}}}}))
    status, printed = run(tmp_path, "mine", "--config-dir", str(tmp_path), "launch=joblib")
    assert status == 0 and "| lr 0.02 |" in printed
    names = json.loads(tracking.read_artifact(f"sqlite:///{tmp_path / 'mlflow.db'}",
                                              stored(tmp_path, "mine")[0].run_id, "jobs.json"))
    assert names == ["optimizer.lr=0.01", "optimizer.lr=0.02"]
