"""What a GPU is asked first, within the minutes that there are."""

from itertools import islice
from pathlib import Path

import pytest
from commands import run_here
from configured import composed

from benchmarks import gpu_plan, record
from benchmarks.gpu_plan import Item, Place
from fractal_exp.cli import configuration
from fractal_exp.methods.chaotic.method import Chaotic

SOMEWHERE = Place(Path("somewhere"))
SLEEP = ("timeit", "-n1", "-r1", "import time; time.sleep(60)")


def answer(item: str, ended: str = "done", kernels: str | None = None, seconds: float = 100.0) -> dict:
    return {"item": item, "ended": ended, "kernels": kernels or gpu_plan.kernels(), "seconds": seconds}


def next_name(*known: dict) -> str:
    return next(gpu_plan.open_items(gpu_plan.items(SOMEWHERE), known)).name


def test_the_tests_come_first_and_no_item_twice():
    names = [item.name for item in islice(gpu_plan.items(SOMEWHERE), 60)]
    assert names[:2] == ["checks", "stretched-0"] and len(set(names)) == 60


@pytest.mark.parametrize(("known", "name"), [
    ([], "checks"), ([answer("checks")], "stretched-0"), ([answer("checks", "failed")], "stretched-0"),
    ([answer("checks", "time was up")], "checks"), ([answer("checks", kernels="others")], "checks"),
    ([answer("checks"), answer("stretched-0", "failed")], "stretched-0")])
def test_an_item_is_open_until_todays_kernels_have_answered_it(known, name):
    assert next_name(*known) == name


def test_the_time_that_an_item_took_takes_the_place_of_the_guess():
    item = Item("checks", "", 3, ())
    assert gpu_plan.expected(item, []) == 180
    known = [answer("checks", seconds=10), answer("checks", seconds=50), answer("checks", "time was up", seconds=5)]
    assert gpu_plan.expected(item, known) == pytest.approx(1.1 * 50)


@pytest.mark.parametrize(("commands", "seconds", "ended"), [
    ([("platform",), ("platform",)], 60, "done"), ([("platform",), ("no_such_module",)], 60, "failed"),
    ([("platform",), SLEEP], 2, "time was up")])
def test_commands_run_side_by_side_until_time_is_up(commands, seconds, ended, tmp_path):
    found = gpu_plan.run(Item("some", "", 1, tuple(commands)), Place(tmp_path), seconds)
    assert found["ended"] == ended and found["seconds"] < 30
    assert len(found["printed"]) == 2 and found["printed"][0]


def test_without_weights_nothing_begins(tmp_path):
    status, printed = run_here(gpu_plan, "--output", str(tmp_path))
    assert status == 2 and "--weights must name a file of torchvision's SqueezeNet 1.1, got None" in printed


@pytest.mark.parametrize("words", [words for item in islice(gpu_plan.items(SOMEWHERE), 40) for words in item.commands
                                   if words[0] == "fractal_exp.cli"])
def test_what_is_asked_for_is_a_fit_at_the_papers_sizes(words):
    method = configuration.build(configuration.resolve(composed(*words[2:], "device=cpu", "perceptual=none")).method)
    assert isinstance(method, Chaotic) and method.model.resolution == 1024
    assert method.iterations == (gpu_plan.SHORT if f"iterations={gpu_plan.SHORT}" in words else 15_000)


def test_a_machine_that_lacks_something_is_not_asked_on(tmp_path, monkeypatch):
    failing = [Item(str(k), "", 1, (("no_such_module",),)) for k in range(9)]
    monkeypatch.setattr(gpu_plan, "items", lambda place: iter(failing))
    status, printed = run_here(gpu_plan, "--rehearse", "--output", str(tmp_path))
    assert status == 1 and "2 items failed in a row" in printed
    assert len(gpu_plan.answers(tmp_path / "rehearsal")) == 2


@pytest.mark.slow
def test_a_rehearsal_answers_in_order_and_goes_on_where_it_ended(tmp_path):
    words = ["--rehearse", "--output", str(tmp_path), "--items", "5"]
    assert "left for another time: checks" in run_here(gpu_plan, *words, "--minutes", "0")[1]
    status, printed = run_here(gpu_plan, *words, "--minutes", "9")
    assert status == 0 and "left for another time: nothing" in printed
    found = [each["figures"] for each in record.read(tmp_path / "rehearsal" / gpu_plan.RECORDS)]
    assert [each["item"] for each in found] == ["checks", "stretched-0", "released-0", "area-0", "operations"]
    assert {each["ended"] for each in found} == {"done"}
    assert "eval/f1" in found[1]["scores"][0] and found[4]["measured"]["operations"]
    assert run_here(gpu_plan, *words)[1] == "left for another time: nothing\n"
