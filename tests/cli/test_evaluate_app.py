"""fractal-evaluate from codes to tables, report and runs."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from commands import refusal
from PIL import Image

from fractal_exp import IFS, InputError, codes, tracking
from fractal_exp.cli import evaluate as app
from fractal_exp.cli.candidates import gather
from fractal_exp.evaluation import evaluate
from fractal_exp.ifs import attractor
from fractal_exp.suite import random_suite

SMALL = ["--resolution", "64", "--points", "200000"]


def save_two(folder):
    """Fractal 0 as it is, fractal 3 without its last map, which everybody can see."""
    (folder / "mine").mkdir()
    zero, three = (attractor.normalize(random_suite(4)[i]) for i in (0, 3))
    zero.save(folder / "mine" / "fit-000.json")
    IFS(three.linear[:-1], three.offset[:-1]).save(folder / "mine" / "fit-003.json")


def test_a_folder_of_codes_becomes_tables_strips_and_a_report(folder, capsys):
    save_two(folder)
    app.main(["mine", "--truth", "suite", "--out", "judged", *SMALL, "--cache", "truths"])
    per_view = pd.read_parquet(folder / "judged" / "per_view.parquet")
    assert len(per_view) == 2 * 4 * 7 and per_view.attrs["perceptual"] == "none"
    assert set(per_view.method) == {"result", "ceiling", "all white", "all black"}
    rows = per_view[(per_view.method == "result") & (per_view.fractal == "fit-000")].reset_index(drop=True)
    [code] = random_suite(1)
    direct = evaluate(attractor.normalize(code), code, resolution=64, points_in_view=200_000)
    for column in ("f1", "iou", "psnr", "ssim"):
        np.testing.assert_allclose(rows[column], direct[column], rtol=1e-6)
    pd.testing.assert_frame_equal(pd.read_csv(folder / "judged" / "per_view.csv"), per_view, check_dtype=False)
    means = per_view.groupby("method").f1.mean()
    assert means["ceiling"] > means["result"] > means["all white"] > means["all black"]
    table = pd.read_csv(folder / "judged" / "codes.csv", index_col="fractal")
    assert table.loc["fit-000", "exact"] and table.loc["fit-000", "displacement_px"] < 0.1
    assert not table.loc["fit-003", "exact"] and table.loc["fit-003", "missed"] >= 1
    assert table.loc["fit-003", "maps"] == table.loc["fit-003", "true_maps"] - 1
    summary = pd.read_csv(folder / "judged" / "summary.csv")
    assert set(summary.zoom_class) == {"all", "whole", "1-2x", "2-4x", "4-8x"}
    assert sorted(path.name for path in (folder / "judged" / "strips").iterdir()) == ["fit-000.png", "fit-003.png"]
    assert np.asarray(Image.open(folder / "judged" / "strips" / "fit-003.png")).max() == 255
    report = (folder / "judged" / "report.txt").read_text()
    assert report in capsys.readouterr().out
    for words in ("ceiling", "all white", "4-8x", "recovered exactly", "no perceptual distance"):
        assert words in report
    assert len(list((folder / "truths").glob("*.npz"))) == 14


def test_a_fit_knows_its_truth_and_a_judgement_is_logged(folder):
    fern = attractor.normalize(replace(codes.known("fern"), probabilities=None))
    fit = folder / "outputs" / "fits" / "fern-chaotic"
    fit.mkdir(parents=True)
    fern.save(fit / "code.json")
    fern.save(fit / "truth.json")
    (fit / "finished.json").write_text("{}")
    app.main([str(fit.parent), *SMALL, "--out", "judged", "--track", "judgements"])
    uri = tracking.prepare_store(folder / "outputs")
    run = tracking.runs_frame(uri, "judgements").iloc[0]
    assert run["status"] == "FINISHED" and run["metrics.eval/f1"] > 0.95 and run["metrics.eval/exact_fraction"] == 1
    assert run["params.views"] == "attractor" and run["tags.scale"] == "laptop"
    assert len(tracking.read_table(uri, run["run_id"], "per_view.json")) == 28
    assert tracking.read_artifact(uri, run["run_id"], "strips/fern-chaotic.png").startswith(b"\x89PNG")
    assert run["tags.mlflow.loggedImages"] == "True", "the strips are in the list of images too"

    # A run that holds a code and its truth is judged like its folder.
    with tracking.start_run(uri, "fits", "fern", folder=fit) as logged:
        logged.artifact("code.json", fit / "code.json")
        logged.artifact("truth.json", fit / "truth.json")
    [candidate] = gather([f"run:{logged.run_id}"], None, folder / "outputs")
    assert torch.equal(candidate.code.offset, fern.offset)
    assert torch.equal(candidate.aim.truth.linear, fern.linear)
    with pytest.raises(InputError, match="cannot read run"):
        gather(["run:0123"], None, folder / "outputs")


@pytest.mark.parametrize(("arguments", "message"), [
    (["mine"], "Name its truth"),
    (["mine", "--truth", "ferm"], "did you mean 'fern'? give"),
    (["mine", "--truth", "suite", "--views", "all"], "views must be one of attractor, released, uniform"),
    (["mine", "--truth", "true"], "true/fit-000.json"),
    (["empty", "--truth", "suite"], "holds neither codes"),
    (["none.json", "--truth", "suite"], "cannot read the code"),
    (["mine/other.txt", "--truth", "suite"], "number 1 of map 1 must be a number, got 'no'"),
    (["mine", "mine", "--truth", "suite"], "two codes are called"),
    (["run:5", "--truth", "suite"], "no runs are kept"),
    (["bare"], "bare: neither truth.json nor target.png is kept"),
    (["mine", "--truth", "suite", "--resolution", "0"], "--resolution must be an integer of at least 1, got 0"),
    (["mine", "--truth", "suite", "--resolution", "10000000000"], "lower --resolution"),
    (["mine", "--truth", "suite", "--resolution", "41", "--perceptual", "fractal"], "raise --resolution to 42"),
    (["mine", "--truth", "suite", "--out", "mine/other.txt"], "mine/other.txt: File exists; choose a folder"),
])
def test_what_a_user_can_mend_is_one_line(folder, arguments, message):
    save_two(folder)
    (folder / "empty").mkdir()
    (folder / "true").mkdir()
    (folder / "mine" / "other.txt").write_text("no code")
    (folder / "bare").mkdir()
    codes.known("fern").save(folder / "bare" / "code.json")
    (folder / "bare" / "finished.json").write_text("{}")
    error = refusal(app, *arguments)
    assert message in error and error.startswith("fractal-evaluate: error:")
