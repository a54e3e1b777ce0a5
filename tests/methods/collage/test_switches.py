"""Parts of collage search that a setting switches off, beside those that are switched off by odds and counts of 0."""

import pytest
import torch
from collage_helpers import COVERAGE, DENSITY, measure_search, objective, problem, tied

from fractal_exp import codes
from fractal_exp.ifs import attractor
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.simplify.likeness import without_unseen
from fractal_exp.methods.collage.simplify.pruning import Price, pruned
from fractal_exp.methods.collage.stages.measure import Restart
from fractal_exp.methods.collage.state import State
from fractal_exp.suite import target


@pytest.fixture(scope="module")
def doubled():
    """The triangle with one of its maps twice, and its grey image of 32²."""
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    maps = affine.from_code(code)
    return torch.cat([maps, maps[:1]]), target(code, 32)


@pytest.mark.parametrize(("pruning", "left"), [(True, 3), (False, 4)])
def test_maps_that_are_not_worth_their_price_stay_without_pruning(doubled, pruning, left):
    maps, image = doubled
    picture = objective(image, moves={"pruning": pruning})
    assert len(pruned(picture, picture.judge(maps), Price(10.0), least=3).maps) == left


@pytest.mark.parametrize(("options", "left"), [({}, 3), ({"search": {"pruning": False}}, 4),
                                               ({"search": {"pruning": False}, "at_most": 3}, 3)])
def test_a_set_on_the_measure_is_pruned_unless_that_is_off_and_its_number_of_maps_is_allowed(doubled, options, left):
    maps, image = doubled
    search = measure_search(DENSITY.measure(image), 32, **options)
    maps = torch.cat([maps[:3], torch.tensor([[0.02, 0, 0, 0.02, 0.3, -0.2]])])   # the last is hardly worth anything
    weights = torch.tensor([0.166, 0.166, 0.166, 0.002])
    found = search.pruned(*search.descend_one(maps, weights, search.params.search.prune))
    assert len(found.maps) == left


def test_a_map_that_nobody_sees_stays_if_none_is_to_be_dropped(doubled):
    maps, image = doubled
    picture = objective(image, COVERAGE, moves={"unseen": None})
    shown = picture.judge(maps)
    assert without_unseen(picture, shown, 0) is shown


@pytest.mark.parametrize(("scores", "wanted"), [((), True), ((0.5,), True), ((0.5, 0.6), True), ((0.5, 0.505), False),
                                                ((1.5, 1.5), True)])
def test_a_restart_is_left_out_once_two_have_agreed_on_a_right_number_of_maps(doubled, scores, wanted):
    maps, image = doubled
    best = tied(maps, 0.0)
    state = State(best=best if not scores else type(best)(maps, None, 0.0, scores[0]), scores=scores)
    assert Restart(problem(image), 0, 2).is_wanted(state) == wanted
