"""Files of a right form with wrong values: each value of each file that a program keeps is replaced by others, one at a
time. A reader answers with a value that can be used, or with an `InputError` in one short line."""

import copy
import json
import random

import numpy as np
import pytest
from crafted import HUGE, crafted
from known import Known

from fractal_exp import InputError, Inversion, codes
from fractal_exp.cli.folders import FitFolder
from fractal_exp.cli.jobs import Outcome, describe_scores
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import ReadImage
from fractal_exp.inversion import run
from fractal_exp.methods.base import CodeReconstruction, Progress
from fractal_exp.rendering.still import render

FEW = 40  # crafted files of each kind in the quick tests


def text_of(data):
    return json.dumps(data).replace(f'"{HUGE}"', "1" + "0" * 400)


def attack(data, read, few, below=()):
    """Let a reader read crafted data, given as text; some of it by lot in the quick tests."""
    found = list(crafted(data, below))
    for path, value, other in random.Random(0).sample(found, FEW) if few else found:
        try:
            read(text_of(other))
        except InputError as error:
            assert "\n" not in str(error) and len(str(error)) < 1000, f"{path} {value!r:.80}: {str(error)[:300]!r}"
        except Exception as error:
            raise AssertionError(f"{path} {value!r:.80}: {type(error).__name__}: {error}") from error


FEW_OR_ALL = pytest.mark.parametrize("few", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["few", "all"])


@pytest.fixture(scope="module")
def inversion(tmp_path_factory):
    """The folder of an inversion, which has a value in every place."""
    folder = tmp_path_factory.mktemp("inversion")
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    image = render(code, resolution=64, points_in_view=20_000)
    method = Known(CodeReconstruction(code), [Progress(1, 0.5, {"error": 1.0}, stage="first", code=code)])
    target = ReadImage.of_drawing(image, "density")
    run(target, method, name="known", options={"camera": {"pen_px": None}, "levels": "auto"}).save(folder)
    data = json.loads((folder / "inversion.json").read_text())
    facts = data["meta"]["inversion"]
    facts |= {"notes": ["a"], "warnings": ["b"], "source": str(folder / "target.png"),
              "curve": [{"maps": 3, "likeness": 0.5, "bytes": 42, "code": {key: data[key] for key in (
                  "format", "version", "linear", "offset")}}]}
    facts["camera"] |= {"gain": 0.5, "pen_px": 1.0}
    (folder / "inversion.json").write_text(json.dumps(data))
    return folder, data


@FEW_OR_ALL
def test_an_inversion(inversion, few):
    folder, data = inversion

    def read(text):
        (folder / "inversion.json").write_text(text)
        found = Inversion.load(folder)
        assert found.target.image.shape == (64, 64) and str(found) and found.facts()["version"] == 2
        assert np.isfinite(found.placement.to_canvas((0, 0))).all()
    read(text_of(data))
    attack(data, read, few, ("meta",))


def test_an_inversion_does_not_become_as_large_as_its_file_says(inversion):
    folder, data = inversion
    other = copy.deepcopy(data)
    other["meta"]["inversion"]["resolution"] = 60_000
    (folder / "inversion.json").write_text(json.dumps(other))
    with pytest.raises(InputError, match="target.png has 64 px a side, expected 60000"):
        Inversion.load(folder)


def job_is_usable(folder):
    outcome = Outcome.read(folder)
    return f"{outcome.seconds:.0f}" and isinstance(describe_scores(outcome), str)


IDENTITY = {"model": {"maps": 3}, "seed": 0}
RECORDS = {  # of a fit or a job, and whether what is read of it can be used
    "finished.json": lambda fit: all(f"{score:.3f}" for score in fit.finished_scores(IDENTITY).values()),
    "run.json": lambda fit: isinstance(fit.run_to_resume("sqlite:///mlflow.db"), str | None),
    "outcome.json": lambda fit: job_is_usable(fit.path),
}


@FEW_OR_ALL
@pytest.mark.parametrize("name", RECORDS)
def test_a_record(tmp_path, name, few):
    fit = FitFolder.open(tmp_path, "fit")
    fit.finish(IDENTITY, {"eval/f1": 0.5, "time/fit_seconds": 12.5})
    fit.remember_run("sqlite:///mlflow.db", "abc")
    fit.checkpoint.touch()
    Outcome("finished", "full", "7", 12.5, {"eval/f1": 0.5}).write(fit.path)

    def read(text):
        (fit.path / name).write_text(text)
        assert RECORDS[name](fit)
    attack(json.loads((fit.path / name).read_text()), read, few)
