"""What a fit leaves behind is judged by what its target was drawn with, or by its picture, and is data alone."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from commands import refusal
from configured import composed
from networks_helpers import saved
from PIL import Image
from train_helpers import train as tiny_fit

from fractal_exp import IFS, InputError, codes, tracking
from fractal_exp.cli import candidates
from fractal_exp.cli import evaluate as app
from fractal_exp.cli.candidates import gather
from fractal_exp.cli.folders import FitFolder
from fractal_exp.ifs import attractor
from fractal_exp.suite import random_suite, target
from fractal_exp.targets import KnownCode

train = partial(tiny_fit, "resolution=64")
COARSE = ["evaluation.resolution=32", "evaluation.points_in_view=20000"]
SCORES = ["f1", "iou", "psnr", "ssim"]


def cross(path: Path) -> Path:
    image = np.full((64, 64), 255, np.uint8)
    image[10:54, 28:36] = image[28:36, 10:54] = 0
    image[10, 28:36] = 250  # a faint edge
    Image.fromarray(image).save(path)
    return path


@pytest.mark.parametrize("probabilities", ["area", pytest.param("published", marks=pytest.mark.slow)])
def test_the_fern_scores_the_same_in_train_and_evaluate(folder, probabilities):
    scores = train("target=known", f"target.probabilities={probabilities}", "name=fern", "tracking=none")
    kept = IFS.load(folder / "outputs" / "fits" / "fern" / "truth.json")
    assert (kept.probabilities is None) == (probabilities == "area")
    app.main(["outputs/fits", "--resolution", "64"])
    table = pd.read_parquet(folder / "evaluation" / "per_view.parquet")
    result = table[table.method == "result"].reset_index(drop=True)
    trained = pd.read_csv(folder / "outputs" / "fits" / "fern" / "per_view.csv")
    for name in SCORES:
        np.testing.assert_allclose(result[name], trained[name], rtol=1e-9)
        assert scores[f"eval/{name}"] == pytest.approx(result[name].mean(), rel=1e-9)
    [row] = pd.read_csv(folder / "evaluation" / "codes.csv").itertuples()
    assert row.probabilities == {"area": "area", "published": "own"}[probabilities]
    assert "map probabilities of the truths: " in (folder / "evaluation" / "report.txt").read_text()


def test_a_target_is_drawn_with_the_probabilities_that_its_truth_states():
    area, published = KnownCode("fern").load(64), KnownCode("fern", probabilities="published").load(64)
    assert not torch.equal(area.image, published.image)
    for each in (area, published):
        assert torch.equal(target(each.truth, 64), each.image)
    with pytest.raises(InputError, match="gives no probabilities; take target.probabilities=area"):
        KnownCode("sierpinski_triangle", probabilities="published")


def test_a_classic_named_as_truth_is_the_one_that_targets_are_drawn_with(folder):
    codes.known("fern").save(folder / "mine.json")
    [named] = gather(["mine.json"], "fern", ".")
    assert named.aim.truth.probabilities is None
    [own] = gather(["mine.json"], "mine.json", ".")
    assert torch.equal(own.aim.truth.probabilities, codes.known("fern").probabilities)


def test_fits_of_codes_and_of_pictures_are_judged_apart(folder, capsys):
    train("target=suite", "target.index=2", "name=two")
    scores = train("target=image", f"target.path={cross(folder / 'cross.png')}", "name=cross")
    (folder / "cross.png").unlink()
    app.main(["outputs/fits", "--resolution", "32", "--track", "judgements"])
    report = capsys.readouterr().out
    assert "1 code, mean of 7 views each" in report and "1 code of pictures against the input" in report
    assert "unfinished" not in report
    judged = pd.read_parquet(folder / "evaluation" / "per_view.parquet")
    assert set(judged.fractal) == {"two"} and len(pd.read_csv(folder / "evaluation" / "codes.csv")) == 1
    inputs = pd.read_csv(folder / "evaluation" / "inputs.csv")
    assert inputs.method.tolist() == ["result", "all white", "all black"]
    assert set(inputs.against) == {"input"} and set(inputs.resolution) == {64} and set(inputs.input) == {"target.png"}
    for name in SCORES:
        assert inputs[name][0] == pytest.approx(scores[f"eval/{name}"], rel=1e-4)
    assert inputs.f1[0] == pytest.approx(scores["eval/f1"], rel=1e-12), "not a pixel gets lost"
    assert {path.name for path in (folder / "evaluation" / "strips").iterdir()} == {"two.png", "cross.png"}
    uri = tracking.prepare_store(folder / "outputs")
    run = tracking.runs_frame(uri, "judgements").iloc[0]
    assert run["metrics.input/f1"] == pytest.approx(inputs.f1[0]) and 0 <= run["metrics.eval/f1"] <= 1

    # The run of a fit holds its truth or its picture too.
    picture, code = (gather([f"run:{run_id}"], None, folder / "outputs")[0].aim
                     for run_id in tracking.runs_frame(uri, "fits")["run_id"])
    assert picture.truth is None and picture.picture.shape == (64, 64)
    assert torch.equal(code.truth.linear, random_suite(3)[2].linear)


def test_unfinished_fits_are_named(folder, capsys):
    train("target=known", "name=fern", "tracking=none", *COARSE)
    for name in ("begun", "fern2"):
        (folder / "outputs" / "fits" / name).mkdir()
        (folder / "outputs" / "fits" / name / "config.yaml").write_text("seed: 0")
    app.main(["outputs/fits", "--resolution", "32"])
    assert "not judged, since unfinished: begun, fern2; the same command with resume=true" in capsys.readouterr().out


@pytest.mark.slow
def test_fits_that_found_no_code_are_named(folder, capsys):
    file = saved(folder / "weights", "super_resolution")
    words = ["tracking=none", "target=suite", *COARSE]
    train("method=super_resolution", f"weights.super_resolution={file}", "name=larger", *words)
    assert "holds no code, but images that were enlarged" in refusal(app, "outputs/fits")
    train("method=neural_regression", f"weights.neural_regression={saved(folder / 'other', 'neural_regression')}",
          "network_side=16", "name=regressed", *words)
    capsys.readouterr()
    app.main(["outputs/fits", "--resolution", "32"])
    printed = capsys.readouterr().out
    assert "not judged, since they found no code: larger; fractal-train has judged them" in printed
    assert set(pd.read_csv(folder / "evaluation" / "codes.csv")["fractal"]) == {"regressed"}


def test_a_fit_with_other_weights_is_another_fit(folder):
    words = ["method=neural_regression", "network_side=16", "name=fit", "tracking=none", *COARSE,
             "weights.neural_regression=weights"]
    saved(folder / "weights", "neural_regression")
    scores = train(*words)
    assert train(*words, "resume=true") == scores
    saved(folder / "weights", "neural_regression", seed=1)
    with pytest.raises(InputError, match="holds a fit of another configuration: fingerprint: "):
        train(*words, "resume=true")


def test_a_kept_picture_loses_no_lit_pixel(tmp_path):
    image = torch.rand(32, 32, generator=torch.Generator().manual_seed(0))
    image[0, :4] = torch.tensor([0.0, 1e-9, 1e-6, 1.0])
    folder = FitFolder.open(tmp_path, "fit")
    assert folder.keep_target(image, None).name == "target.png"
    back = candidates.read_aim({"target.png": (folder.path / "target.png").read_bytes()}.get, "").picture
    assert torch.equal(back > 0, image > 0) and float((back - image).abs().max()) < 2e-5
    folder.keep_target(image, codes.known("tree"))
    assert not (folder.path / "target.png").exists() and (folder.path / "truth.json").exists()


@pytest.fixture
def kept(folder) -> Path:
    """The folder of a finished fit."""
    kept = folder / "fit"
    kept.mkdir()
    attractor.normalize(codes.known("fern")).save(kept / "code.json")
    (kept / "finished.json").write_text(json.dumps({"identity": {"target": {"_target_": "os.system"}}, "scores": {}}))
    return kept


def test_what_a_record_says_of_a_target_is_not_read(kept):
    [candidate] = gather([str(kept)], None, ".")
    assert candidate.aim.truth is None and candidate.aim.picture is None


DAMAGED = {
    "truth.json": [b"", b"[" * 100_000, b"[[1]]", b"[[2, 0, 0, 2, 0, 0]]"],
    "target.png": [b"", b"\x89PNG\r\n\x1a\n"],
}


@pytest.mark.parametrize(("name", "data"), [(name, data) for name, all_ in DAMAGED.items() for data in all_],
                         ids=lambda value: str(value)[:30])
def test_a_damaged_file_gets_one_line_that_names_it(kept, name, data):
    (kept / name).write_bytes(data)
    line = refusal(app, kept)
    assert f"fit/{name}" in line and len(line) < 500


@pytest.mark.parametrize(("scale", "views"), [("laptop", "attractor"), ("smoke", "attractor"), ("paper", "released")])
def test_only_the_papers_scale_is_judged_on_the_views_of_its_program(scale, views):
    assert composed(f"scale={scale}").evaluation.views == views
    assert composed(f"scale={scale}", "evaluation.views=uniform").evaluation.views == "uniform"
    assert app.SCALES.get(scale, {"views": views})["views"] == views
