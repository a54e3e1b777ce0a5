"""What a fit, a run or a weight file holds is refused by its size before it is read."""

import os

import pytest
import torch
from commands import refusal

from fractal_exp import InputError, codes, tracking
from fractal_exp.cli import evaluate as app
from fractal_exp.cli.candidates import gather
from fractal_exp.perceptual import fractal_features
from fractal_exp.runtime import weights
from fractal_exp.runtime.tensors import packed


@pytest.fixture
def fit(tmp_path):
    """The folder of a finished fit of the fern."""
    folder = tmp_path / "fit"
    folder.mkdir()
    codes.known("fern").save(folder / "code.json")
    (folder / "finished.json").write_text("{}")
    return folder


@pytest.mark.parametrize(("name", "most"), [("code.json", 2**24), ("truth.json", 2**24), ("target.png", 2**28)])
def test_a_fits_file_that_is_too_large_ends_in_one_line(fit, name, most):
    with open(fit / name, "ab") as file:
        file.truncate(most + 1)  # takes no room on the disk
    assert f"fit/{name}: it has {most + 1} bytes, at most {most} are read" in refusal(app, fit)


def test_an_artifact_that_is_too_large_is_not_fetched(fit, tmp_path):
    uri = tracking.prepare_store(tmp_path)
    with tracking.start_run(uri, "fits", "fern", folder=tmp_path) as run:
        run.artifact("code.json", "x")
        run.artifact("truth.json", "{}")
    [logged] = tracking.runs_frame(uri, "fits").itertuples()
    assert tracking.read_artifact(uri, logged.run_id, "truth.json", 2) == b"{}"
    [kept] = tmp_path.glob("mlartifacts/**/code.json")
    os.truncate(kept, 2**40)  # takes no room on the disk, but no memory holds it
    with pytest.raises(InputError, match=f"'code.json' of run .* has {2**40} bytes, at most {2**24} are read"):
        gather([f"run:{logged.run_id}"], None, tmp_path)


@pytest.mark.parametrize(("recipe", "message"), [
    ("[" * 100_000, "damaged: its notes is no JSON that can be read: its lists are nested too deeply"),
    ('{"steps": 1, "steps": 2}', "damaged: its notes gives the key 'steps' twice"),
])
def test_a_crafted_recipe_of_weights_is_refused(tmp_path, recipe, message):
    told = f'{{"network": "fractal_features", "scores": {{}}, "recipe": {recipe}}}'
    (tmp_path / "mine.safetensors").write_bytes(packed({"a": torch.zeros(2)}, weights.FORMAT, "trained", told))
    with pytest.raises(InputError, match=message):
        fractal_features.load(tmp_path / "mine.safetensors")


def test_weights_that_are_huge_or_no_file_are_not_read(tmp_path):
    with open(tmp_path / "huge.safetensors", "wb") as file:
        file.truncate(2**31 + 1)
    with pytest.raises(InputError, match="cannot read the weights .* at most 2147483648 are read"):
        fractal_features.load(tmp_path / "huge.safetensors")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="cannot read the weights .* it is a pipe"):
        fractal_features.load(tmp_path / "pipe")
