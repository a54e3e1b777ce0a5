"""Amortised set prediction: its matching and its answers by hand, and what it refuses."""

import itertools

import pytest
import torch
from configured import composed
from networks_helpers import TRAININGS, saved
from rivals_helpers import TARGET

from fractal_exp import InputError, invert
from fractal_exp.cli import configuration
from fractal_exp.methods.amortized.method import Amortized, chosen
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.training.amortized import match


@pytest.fixture
def file(tmp_path):
    return str(saved(tmp_path / "net.safetensors", "amortized"))


def test_the_match_has_the_least_sum_of_squared_errors():
    random = torch.Generator().manual_seed(0)
    maps, truth = torch.randn(2, 5, 6, generator=random), torch.randn(2, 4, 6, generator=random)
    truth[1, 1] = torch.nan  # a code of three maps
    for these, those, slots in zip(maps, truth, match(maps, truth), strict=True):
        present = those.isfinite().all(1)
        assert len(set(slots.tolist())) == 4
        ours = float((these[slots] - those)[present].square().sum())
        every = [float((these[list(some)] - those[present]).square().sum())
                 for some in itertools.permutations(range(5), int(present.sum()))]
        assert ours == pytest.approx(min(every))


def test_the_loss_is_that_of_the_matched_maps_and_of_whether_they_are_there():
    training = TRAININGS["amortized"](presence=1.0)
    truth = torch.full((1, 10, 6), torch.nan)
    truth[0, :2] = torch.tensor([[1.0] * 6, [-1.0] * 6])
    maps, logits = torch.zeros(1, 10, 6), torch.full((1, 10), -50.0)
    maps[0, 3], maps[0, 7] = -1.0, 1.5
    logits[0, 3] = logits[0, 7] = 50.0
    assert float(training.set_loss((maps, logits), truth)) == pytest.approx(.5 * .5**2, abs=1e-6)
    swapped = maps[:, torch.randperm(10)], torch.zeros(1, 10)
    assert float(training.set_loss(swapped, truth)) == pytest.approx(.5 * .5**2 + .693147, abs=1e-5), "in no order"


def test_the_loss_teaches_the_matched_maps_alone():
    training = TRAININGS["amortized"](presence=0.0)
    maps = torch.randn(1, 10, 6, generator=torch.Generator().manual_seed(2)).requires_grad_()
    truth = torch.full((1, 10, 6), torch.nan)
    truth[0, :4] = torch.randn(4, 6, generator=torch.Generator().manual_seed(3))
    training.set_loss((maps, torch.zeros(1, 10)), truth).sum().backward()
    assert int(maps.grad[0].abs().sum(1).gt(0).sum()) == 4 and bool(maps.grad.isfinite().all())


def test_likely_maps_are_chosen_and_so_many_at_least():
    chances = torch.tensor([.2, .9, .4, .6])
    assert chosen(chances, .5, 2).tolist() == [1, 3]
    assert chosen(chances, .3, 2).tolist() == [1, 2, 3]
    assert chosen(chances, 1.0, 2).tolist() == [1, 3] and chosen(chances, 1.0, 9).tolist() == [0, 1, 2, 3]


def test_the_fit_is_one_pass(file):
    seen = []
    found = Amortized(weights=file, side=16).reconstruct(TARGET, on_step=seen.append)
    assert isinstance(found, CodeReconstruction) and 2 <= len(found.code) <= 10 and found.evaluations == 0
    assert len(seen) == 1 and seen[0].fraction == 1 and seen[0].preview.shape == (16, 16)
    assert len(Amortized(weights=file, side=16, present=0.0).reconstruct(TARGET).code) == 10
    by_name = invert(TARGET, method="amortized", frame="keep", weights=file, side=16)
    assert len(by_name.code) == len(found.code) and by_name.method == "amortized"


def test_the_papers_optimiser_refines_what_it_finds(file):
    words = ["init=amortized", f"weights.amortized={file}", "network_side=16", "scale=smoke", "resolution=32",
             "iterations=3"]
    config = configuration.resolve(composed(*words))
    assert configuration.method_name(config.method) == "amortized-chaotic"
    method, alone = configuration.build(config.method), Amortized(weights=file, side=16)
    found = method.reconstruct(TARGET)
    assert len(found.code) == len(alone.reconstruct(TARGET).code)


def test_the_network_in_the_package_looks_at_its_picture():
    """On codes of a seed that it was not trained with."""
    network, found = Amortized().loaded()
    assert found.recipe["seed"] == 0 and found.scores["held_out"] < found.scores["other_pictures"]
    training = TRAININGS["amortized"](side=found.recipe["side"], seed=1, held_out=100)
    with torch.no_grad():
        scores = training.judge(network, "cpu")
    assert scores["held_out"] < .95 * scores["other_pictures"]


def test_options_out_of_range_are_refused():
    for options, message in (({"seconds": 0}, "seconds must be above 0"), ({"side": 20}, "side must be"),
                             ({"present": 2.0}, "present must be at least 0 and at most 1"),
                             ({"fewest": 0}, "must be at least 1")):
        with pytest.raises(InputError, match=message):
            Amortized(**options)
