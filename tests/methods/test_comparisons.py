"""The methods that the paper compares with, as users reach them: one YAML file each, one name in every command."""

import re
from pathlib import Path

import fractal_exp.conf
import pytest
from configured import composed, plain
from fractal_exp.conf.generate import COMPARED, hydra_config
from networks_helpers import saved
from places import ROOT
from rivals_helpers import TARGET

from fractal_exp import InputError, codes, invert
from fractal_exp.cli import configuration
from fractal_exp.evaluation import Perceptual
from fractal_exp.images.reading import ReadImage
from fractal_exp.methods import METHODS, load
from fractal_exp.methods.amortized.method import Amortized
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.methods.neural_regression.method import NeuralRegression
from fractal_exp.methods.stepwise import Stepwise
from fractal_exp.methods.super_resolution.method import SuperResolution
from fractal_exp.studies.judging import judge
from fractal_exp.studies.published import TABLES
from fractal_exp.targets import Target

CONF = Path(next(iter(fractal_exp.conf.__path__)))
PAGE = (ROOT / "docs" / "comparisons.md").read_text()
BY_NAME = {method.name: method for method in (Amortized, NeuralRegression, SuperResolution)}
NETWORKS = [file.split("/")[1] for file in COMPARED if file.startswith("pretraining/")]
each_method = pytest.mark.parametrize("name", [name for group, name in (file.split("/") for file in COMPARED)
                                               if group == "method" and name not in NETWORKS])


def built(*words: str) -> Stepwise:
    return configuration.build(configuration.resolve(composed(*words)).method)


@pytest.mark.parametrize("name", [file.split("/")[1] for file in COMPARED if file.startswith("method/")])
def test_its_file_is_made_from_its_parameters(name):
    assert (CONF / "method" / f"{name}.yaml").read_text() == hydra_config(f"method/{name}"), (
        f"python -m fractal_exp.conf.generate method/{name} > conf/method/{name}.yaml")
    for field, info in type(built(f"method={name}").params).model_fields.items():
        assert info.description, field


@pytest.mark.parametrize("name", NETWORKS)
def test_a_method_with_a_network_has_the_sizes_of_the_laptop_in_the_library(name):
    method = built(f"method={name}")
    assert method.name == name and f"`{name}`" in PAGE
    assert name in TABLES["comparisons"].rows or name == "amortized", "which is younger than the paper"
    assert method.params == type(method.params)()
    with pytest.raises(InputError, match="seconds must be above 0"):
        built(f"method={name}", "seconds=0")


@pytest.mark.parametrize(("name", "options", "message"), [
    ("neural_regression", {"side": 24}, "was trained with images of the side 16, and 24 is asked for .side..*"
                                        "task=pretrain method=neural_regression method.side=24"),
    ("neural_regression", {"maps": 12}, "a number of maps of 10, and 12 is asked for .*method.maps=12"),
    ("neural_regression", {"as_released": True}, "as_released = False, and True .*method.as_released=true"),
    ("amortized", {"side": 24}, "side 16, and 24 is asked for"),
    ("amortized", {"maps": 12}, "a number of maps of 10, and 12 is asked for"),
    ("super_resolution", {"width": 180}, "a width of 32, and 180 is asked for .*method.width=180"),
    ("super_resolution", {"factor": 4}, "was trained with a factor of 8, and 4 is asked for .*method.factor=4"),
    *((name, {"weights": "absent"}, "cannot read the weights .*absent.*`fractal-train task=pretrain "
                                    rf"method={name}( method.side=16)?` trains them") for name in NETWORKS),
    *((name, {"weights": other}, f"holds the network '{other}', expected '{name}'.*`fractal-train task=pretrain "
                                 rf"method={name}( method.side=16)?` trains them")
      for name, other in zip(NETWORKS, NETWORKS[1:] + NETWORKS[:1], strict=True)),
])
def test_a_network_of_another_kind_is_refused_with_the_command_that_trains_one(name, options, message, folder):
    own = {} if name == "super_resolution" else {"side": 16}
    if options.get("weights") in NETWORKS:
        saved(options["weights"], options["weights"])
    found = BY_NAME[name](**own | {"weights": str(saved("own", name))} | options)
    for refuse in (found.check, found.reconstruct):
        with pytest.raises(InputError, match=message):
            refuse(TARGET)


@each_method
def test_the_scale_of_the_paper_has_the_published_budget_and_the_library_that_of_the_laptop(name):
    paper, laptop, library = built(f"method={name}", "scale=paper"), built(f"method={name}"), load(name)()
    assert paper.params == type(paper.params)()
    assert laptop.params == library.params and laptop.steps <= paper.steps
    assert (laptop.seconds, laptop.seed, laptop.device) == (library.seconds, library.seed, library.device)


@each_method
def test_the_tables_and_the_page_know_it(name):
    assert name in METHODS and name in TABLES["comparisons"].rows and f"`{name}`" in PAGE
    paper = plain(f"method={name}", "scale=paper")["budgets"][name]
    laptop = plain(f"method={name}")["budgets"][name]
    row = next(line for line in PAGE.splitlines() if line.startswith(f"| `{name}`"))
    assert [int(number) for number in re.findall(r"\b(\d+) (?:generations|iterations)", row)] == [paper, laptop]


def test_what_was_spent_is_judged_with_the_scores_and_the_truth_where_it_is_asked_for():
    truth = codes.known("sierpinski_triangle")
    options = {"resolution": 32, "points_in_view": 20_000, "supersample": 4, "views": "attractor", "align": "bbox",
               "device": "cpu"}
    target = Target(ReadImage.of_drawing(TARGET, "density"), truth)
    spent = judge(CodeReconstruction(truth, evaluations=700), target, options, Perceptual.load(), 2.0, ceiling=True)
    assert spent.scores["time/evaluations"] == 700 and spent.trivial["trivial/truth_f1"] > .9
    untold = judge(CodeReconstruction(truth), target, options, Perceptual.load(), 2.0)
    assert "time/evaluations" not in untold.scores and "trivial/truth_f1" not in untold.trivial
    assert spent.trivial["trivial/truth_f1"] == pytest.approx(untold.scores["eval/f1"], abs=.03)


def test_an_interrupted_search_has_the_code_of_its_last_stage():
    def interrupt(progress):
        if progress.step == 6:
            raise KeyboardInterrupt

    found = invert(TARGET, method="cuckoo", frame="keep", maps=3, population=6, generations=50, on_step=interrupt,
                   keep_interrupted=True)
    assert found.stopped == "interrupted" and len(found.code) == 3
    whole = invert(TARGET, method="cuckoo", frame="keep", maps=3, population=6, generations=5)
    assert [stage.name for stage in whole.history] == [f"first {k} generations" for k in (1, 2, 4, 5)]
