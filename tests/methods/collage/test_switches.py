"""Parts of collage search that a setting switches off, beside those that are switched off by odds and counts of 0."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch
from collage_helpers import DENSITY, objective, params, problem, random, tied

from fractal_exp import codes
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.image.objective import ImageObjective, reduced
from fractal_exp.methods.collage.moves.search import ImageSearch
from fractal_exp.methods.collage.moves.single import with_new_map
from fractal_exp.methods.collage.simplify.loop import Draft, Price, pruned
from fractal_exp.methods.collage.simplify.removal import one_unseen
from fractal_exp.methods.collage.stages.image import ImageMoves
from fractal_exp.methods.collage.stages.measure import Restart
from fractal_exp.methods.collage.state import State
from fractal_exp.suite import target

TURN = torch.tensor([[-0.499, 0.864, -0.864, -0.499, 0, 0]])   # of the triangle about its middle, but for a little


@pytest.fixture(scope="module")
def doubled():
    """The triangle with one of its maps twice, and its grey image of 32²."""
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    maps = affine.from_code(code)
    return torch.cat([maps, maps[:1]]), target(code, 32)


@pytest.mark.parametrize(("pruning", "left"), [(True, 3), (False, 4)])
def test_maps_that_are_not_worth_their_price_stay_without_pruning(doubled, pruning, left):
    maps, image = doubled
    picture = objective(image, moves={"pruning": pruning}, maps=3)
    assert len(pruned(picture, picture.judge(maps), Price(10.0)).maps) == left


def test_new_maps_are_mirrored_unless_that_is_off(doubled):
    (maps, image), judged = doubled, {True: [], False: []}

    class Told(ImageObjective):
        def judge(self, maps, weights=None):
            judged[self.params.moves.mirrored].append(maps[-1])
            return super().judge(maps, weights)

    for mirrored in True, False:
        seen = Told(image, DENSITY, params(moves={"mirrored": mirrored}))
        shown = seen.judge(maps[:3])
        with_new_map(ImageSearch(seen, DENSITY.measure(image), noise=0.1), seen.without(shown, [0]), shown, maps[0],
                     random())
    more = torch.stack(judged[True][len(judged[False]):])
    assert len(more) == 2 * 3, "the new map and the old one, in each axis and in both"
    assert torch.allclose(affine.volumes(more[3:]), affine.volumes(maps[:1]).expand(3), rtol=0.05), "the old one"


def test_without_cleaning_every_step_is_a_move(doubled):
    stage = ImageMoves(problem(doubled[1], moves={"count": 6, "cleaning": False}))
    stage.search = SimpleNamespace(step=lambda now, number: replace(now, score=1.0))   # `cleaned` is not there
    now = tied(doubled[0])
    assert {stage.move(State(current=now, step=step)).now.score for step in range(stage.most_moves)} == {1.0}


@pytest.mark.parametrize(("unseen", "tried"), [(0.002, 4), (None, 0)])
def test_a_map_that_nobody_sees_stays_if_none_is_to_be_dropped(doubled, unseen, tried):
    picture = objective(doubled[1], simplify={"unseen": unseen})
    assert len(list(one_unseen(Draft(picture, picture.judge(doubled[0]))))) == tried


def test_a_reduced_image_is_only_shrunk_if_nothing_is_to_be_rendered(doubled):
    maps, image = doubled
    off, code = params(image={"reduced_renderings": 0}), affine.to_code(maps)
    assert torch.equal(reduced(image, 16, code, DENSITY, off, 0), DENSITY.shrunk(image, 16))
    assert not torch.equal(reduced(image, 16, code, DENSITY, params(), 0), DENSITY.shrunk(image, 16))


@pytest.mark.parametrize(("scores", "wanted"), [((), True), ((0.5,), True), ((0.5, 0.6), True), ((0.5, 0.505), False),
                                                ((1.5, 1.5), True)])
def test_a_restart_is_left_out_once_two_have_agreed_on_a_right_number_of_maps(doubled, scores, wanted):
    maps, image = doubled
    far = replace(tied(0.5 * maps, 0.0), score=min(scores, default=0.0))
    assert Restart(problem(image), 0, 2).is_wanted(State(best=far, scores=scores)) == wanted


def test_no_restart_follows_once_a_set_draws_a_density_well(doubled):
    maps, image = doubled
    near, far = (State(best=replace(tied(each, 0.0), score=0.5), scores=(0.5,)) for each in (maps[:3], 0.5 * maps[:3]))
    assert Restart(problem(image), 0, 1).is_wanted(far) and not Restart(problem(image), 0, 1).is_wanted(near)
    binary = Restart(problem((image > 0).float(), levels="binary"), 0, 1)
    assert binary.is_wanted(near), "a wrong code may draw it well"
    too_many = replace(near, best=replace(near.leader, score=1.5))
    turned = replace(near, best=replace(near.leader, maps=torch.cat([maps[:3], TURN])))
    assert all(Restart(problem(image), 0, 1).is_wanted(state) for state in (too_many, turned))


def test_later_rounds_have_half_of_the_restarts(doubled):
    given = problem(doubled[1], search={"restarts": 5})
    assert [given.restarts(number) for number in range(3)] == [5, 3, 3]
