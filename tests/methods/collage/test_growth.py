"""Pictures of no code: growth, the curve of likeness over maps, and the choice from it."""

from dataclasses import replace
from itertools import count

import pytest
import torch
from collage_helpers import interrupted, merged, objective, tied
from growth_helpers import BLOB, BRANCH, FEW, LETTER, clouds, grower, stage

from fractal_exp import codes
from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.kinds import levels_of
from fractal_exp.cameras.levels import mean_of
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cameras.pens import Dots
from fractal_exp.cameras.points import counted
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import DRAWN
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.pipeline import Pipeline
from fractal_exp.methods.collage.stages import plan_of
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.construction import Construction
from fractal_exp.methods.collage.stages.growth import UNLIKE, Growth, Promise, Sketch, is_worth_its_maps
from fractal_exp.methods.collage.state import Candidate, Grown, Key, State, WeightedMaps
from fractal_exp.runtime.checkpoint import Checkpoint
from fractal_exp.runtime.deadline import Deadline
from fractal_exp.suite import random_suite, target


def run(image: torch.Tensor, **options) -> tuple[State, list[str]]:
    """The state after a search that ended with a blob, and the stages that came after."""
    told = []
    some = stage(image, **merged({"rounding": {"enabled": False}}, options))
    done = State(done=Key(some.problem.rounds, "rounding"), best=tied(BLOB))
    pipeline = Pipeline(plan_of(some.problem), done, on_move=lambda *_: None,
                        on_stage=lambda each, _: told.append(each.name))
    pipeline.run()
    return pipeline.state, told


def test_so_many_maps_are_grown_as_asked_for_and_the_curve_is_kept():
    found = Collage(maps=24, growth={**FEW, "counts": (6, 12, 48), "steps": 300}).reconstruct(BRANCH)
    assert len(found.code) == 24 and [each.maps for each in found.curve] == [6, 12, 24]
    assert [each.bytes for each in found.curve] == [72, 144, 288]
    assert found.curve[0].likeness < found.curve[-1].likeness > 0.9
    assert torch.equal(found.curve[-1].code.linear, found.code.linear)
    assert found.stopped.startswith("24 maps were grown, likeness ")


@pytest.mark.parametrize("asked", [{"at_most": 10}, {"maps": 10}])
def test_no_more_maps_are_grown_than_asked_for_in_a_photograph(asked):
    growth = stage(clouds(), **asked)
    assert Sketch(growth.problem).counts[-1] == 10 == growth.counts[-1]


def test_bytes_bound_the_number_of_maps():
    found = Collage(bytes=263, growth={**FEW, "counts": (6,)}).reconstruct(LETTER)
    assert len(found.code) == 21 and found.curve[-1].bytes == 252


def test_a_likeness_is_reached_by_the_fewest_maps_of_the_curve():
    state, _ = run(BRANCH, likeness=0.85, growth={"counts": (3, 6, 12, 24)})
    reached = [each.likeness >= 0.85 for each in state.curve]
    assert reached == [False] * (len(reached) - 1) + [True] and 1 < len(reached) < 4
    assert torch.equal(state.result.maps, state.curve[-1].maps)


def test_where_the_search_found_a_blob_maps_are_grown_instead():
    state, told = run(BRANCH)
    assert told == ["growth"] and len(state.result.maps) == len(state.curve[-1].maps) > 2
    assert state.curve[-1].likeness > 0.85 and "maps were grown" in state.stopped
    assert state.result.error < objective(BRANCH).judge(BLOB).error / 2


def test_nothing_is_grown_where_growth_is_switched_off():
    state, told = run(BRANCH, growth={"enabled": False})
    assert told == [] and torch.equal(state.result.maps, BLOB)


def test_where_the_search_found_the_code_nothing_is_grown(triangle):
    code, image = triangle
    right = tied(affine.from_code(code))
    assert not stage(image).is_wanted(State(best=right))
    assert stage(image).is_wanted(State(best=tied(BLOB)))


@pytest.mark.parametrize(("kind", "number"), [("grey", 66), ("binary", 4), ("binary", 19)])
def test_a_code_that_draws_faint_parts_too_is_no_blob(kind, number):
    truth = attractor.normalize(random_suite(67)[number])
    image, right = target(truth, 128, kind), tied(affine.from_code(truth))
    assert not stage(image).is_wanted(State(best=right))
    assert stage(image).is_wanted(State(best=tied(BLOB)))


def test_what_was_found_stays_unless_grown_maps_are_more_like_the_picture():
    some = stage(clouds(), growth={"steps": 200})
    few, many = some.grower.plain(6), some.grower.grown(18)
    promised = replace(few, likeness=2.0)                 # beyond what any drawing has
    for curve, kept in (((few,), many), ((promised,), few), ((many,), many)):
        left = some.close(State(best=many.candidate, curve=curve))
        assert torch.equal(left.result.maps, kept.maps)
    grown = some.close(State(best=few.candidate, curve=(many,)))
    assert torch.equal(grown.result.maps, many.maps) and grown.result.camera == many.camera


@pytest.fixture(scope="module")
def fern_dots() -> tuple[torch.Tensor, Candidate]:
    """A scatter plot of the fern, and its code."""
    code = attractor.normalize(codes.known("fern"))
    dots = Dots(CameraParams(), torch.zeros(96, 96), Camera("dots", gain=0.08, blur=0.5 * 2 / 96))
    return dots.render(code, 96, 0), Candidate(affine.from_code(code), code.probabilities, 0)


def test_a_photograph_ends_the_search_and_a_density_of_others_does_not(fern_dots):
    """The search is as far as two maps that are hardly like the one, and as the true code of the other."""
    for image, found, ends in ((clouds(), tied(BLOB), True), (*fern_dots, False)):
        some = stage(image, growth={"steps": 100, "counts": (8,), "usual": 64})
        sketch, promise = (kind(some.problem) for kind in (Sketch, Promise))
        assert Sketch.may_help(some.problem)
        plan = plan_of(some.problem)
        plan.rounds, plan.last = [[sketch]], []
        begun = Pipeline(plan, State(), on_move=lambda *_: None, on_stage=lambda *_: None)
        begun.run()
        assert begun.state.best is None and begun.state.result is not None, "a code from the start"
        plan.rounds, plan.last = [], [promise]
        searched = Pipeline(plan, replace(begun.state, best=found), on_move=lambda *_: None, on_stage=lambda *_: None)
        searched.run()
        assert searched.state.is_outgrown is ends


@pytest.mark.parametrize(("few", "many", "gain", "worth"), [(2, 64, 0.09, False), (2, 64, 0.11, True),
                                                            (16, 64, 0.05, True), (40, 64, 0.019, False)])
def test_the_more_maps_are_grown_the_more_they_must_gain(few, many, gain, worth):
    found = replace(tied(BLOB), maps=tied(BLOB).maps[:1].repeat(few, 1))
    grown = Grown(found.maps[:1].repeat(many, 1), None, 0.5 + gain, Camera("dots"))
    assert is_worth_its_maps(grown, found, 0.5) is worth


def test_where_maps_are_grown_first_no_construction_is_looked_for():
    for image, grown in (clouds(), True), (BRANCH, False):
        problem = stage(image).problem
        assert Construction.may_help(problem) and Sketch.may_help(problem) is grown
        stages = {type(each) for each in plan_of(problem).stages}
        assert (Sketch in stages, Construction in stages) == (grown, not grown)


@pytest.mark.parametrize(("asked", "first", "shares"), [
    ({}, {64: 0.5}, {6: 0.5, 64: 0.5, 65: 1.0}), ({"at_most": 64}, {64: 1.0}, {6: 0.5, 64: 1.0}),
    ({"maps": 5}, {5: 1.0}, {5: 1.0}), ({"likeness": 0.999}, {64: 1.0}, {6: 1.0, 64: 1.0, 65: 1.0, 66: 1.0})])
def test_what_is_returned_takes_all_steps_and_smaller_numbers_half(asked, first, shares):
    problem = stage(clouds(32), growth={"counts": (6, 64, 65, 66), "usual": 65, "steps": 2}, **asked).problem
    for kind, wanted in ((Sketch, first), (Growth, shares)):
        some, state = kind(problem), State(current=tied(BLOB))
        for _ in wanted:
            state = some.move(state)
        assert {len(each.maps) for each in state.curve} == {*wanted} == {*some.counts}
        for each in state.curve:
            alike = [torch.equal(each.maps, some.grower.grown(len(each.maps), share=share).maps) for share in (0.5, 1)]
            assert alike == [share == wanted[len(each.maps)] for share in (0.5, 1)]


def test_what_a_sketch_has_grown_is_not_grown_again():
    some = stage(clouds(48), seconds=50, growth={"usual": 70, "steps": 1})
    few, many = (replace(some.grower.plain(count), likeness=0.5) for count in (64, 70))
    assert Sketch(some.problem).counts == [64] and some.counts == [70]
    assert some.is_settled(State(curve=(few, many))) and not some.is_settled(State(curve=(few,)))
    after = some.move(State(current=few.candidate, curve=(few,)))
    assert [len(each.maps) for each in after.curve] == [64, 70]
    late = stage(clouds(48), seconds=1e-6, growth={"usual": 70, "steps": 1})
    assert late.is_settled(State(curve=(few,))), "no time is left"


@pytest.mark.parametrize(("used", "first"), [(0.3, 6), (0.7, 70), (1.1, 70)])
def test_late_under_a_limit_the_most_maps_are_grown_first(used, first):
    now = [0.0]
    problem = stage(clouds(48), growth={"usual": 70, "steps": 1}).problem
    some = Growth(replace(problem, deadline=Deadline(100, lambda: now[0])), 2)
    assert some.counts == [6, 12, 70]
    now[0] = 100 * used
    assert len(some.move(State(current=some.grower.plain(6).candidate)).curve[0].maps) == first


def test_however_late_it_is_there_is_a_paving_at_least():
    some = stage(BRANCH, seconds=1e-6)
    state = State(best=tied(BLOB))
    assert some.is_wanted(state) and not some.deadline.passed and some.counts == [18]
    after = some.close(some.move(some.open(state)))
    torch.testing.assert_close(after.result.maps, some.grower.plain(18).maps)


def test_a_search_without_time_for_a_sketch_goes_on():
    told = []
    found = Collage(seconds=1e-6, growth=FEW).reconstruct(clouds(48), on_step=told.append)
    assert len(found.code) and "sketch" not in {each.stage for each in told}


def test_a_search_whose_sketch_took_all_the_time_goes_on():
    some = stage(clouds(48), seconds=1e-6, growth=FEW)
    pipeline = Pipeline(plan_of(some.problem), State(curve=(some.grower.plain(6),)), on_move=lambda *_: None,
                        on_stage=lambda *_: None)
    assert len(pipeline.run().maps) and pipeline.state.stopped


def test_an_interrupted_growth_tells_what_it_has_grown():
    search = Collage(maps=12, likeness=None, growth={**FEW, "steps": 5})
    told = interrupted(search, clouds(), lambda told: len(told) == 2)
    assert [each.stage for each in told] == 3 * ["sketch"] and len(told[2].code) == 12 and told[2].camera.is_known


@pytest.mark.parametrize("image, asked", [(clouds(), {}), (BRANCH, {"maps": 24})], ids=["sketch", "growth"])
def test_a_growth_that_is_interrupted_in_its_first_descent_tells_how_far_it_is(image, asked):
    """By somebody who looks at the clock once for each of its steps, and several times before."""
    told, looks = [], count()

    def clock():
        if next(looks) == 100:
            raise KeyboardInterrupt
        return 0.0

    class Watched(Collage):
        def deadline(self, target):
            return Deadline(1000, clock)

    search = Watched(likeness=None, growth=FEW, **asked)
    with pytest.raises(KeyboardInterrupt):
        search.reconstruct(image, on_step=told.append)
    paved = stage(image, growth=FEW, **asked).grower.plain(len(told[-1].code))
    assert not torch.allclose(affine.from_code(told[-1].code), paved.maps, atol=1e-3)
    assert told[-1].camera.is_known and told[-1].code.contraction


def test_growth_goes_on_where_it_was_interrupted(tmp_path):
    path, options = tmp_path / "growth.safetensors", {"maps": 24, "growth": {**FEW, "steps": 5}}
    whole = Collage(**options).reconstruct(BRANCH)
    told = interrupted(Collage(**options), BRANCH, lambda told: len(told) == 2, Checkpoint(path))
    assert {each.stage for each in told} == {"growth"}
    resumed = Collage(**options).reconstruct(BRANCH, checkpoint=Checkpoint(path, resume=True))
    assert torch.equal(whole.code.linear, resumed.code.linear) and torch.equal(whole.code.offset, resumed.code.offset)
    assert [each.likeness for each in whole.curve] == [each.likeness for each in resumed.curve]


def test_a_code_keeps_its_likeness_in_two_bytes_a_number():
    some = grower(BRANCH)
    found = some.grown(18)
    rounded = WeightedMaps(torch.round(found.maps * 2**14) / 2**14, found.weights)
    assert some.likeness(rounded, found.camera) > found.likeness - 0.02


def test_a_code_that_explains_a_plot_of_dots_to_its_noise_is_not_replaced_by_grown_maps():
    """Dots fall by chance, so a right code is not very like them, and many maps may be more so."""
    terdragon, count, cells = attractor.normalize(codes.known("terdragon")), 16_000, 512
    plot = mean_of(counted(terdragon, cells, count, 0).clamp(max=1), 128)
    levels = levels_of(plot, DRAWN, CollageParams().camera)
    growth, five = (Growth(SearchProblem(plot, levels, CollageParams(maps=maps))) for maps in (None, 5))
    right, wrong = affine.from_code(terdragon), affine.from_code(terdragon)[:2]
    dots = Camera("dots", gain=count / cells**2, blur=0.0)
    found = [Candidate(maps, None, 0.0, 0.0, dots) for maps in (right, wrong)]
    assert Sketch.may_help(growth.problem) and growth.grower.likeness(found[0], dots) < 0.9
    sketch = growth.grower.plain(8)
    assert [growth.is_wanted(State(best=each, curve=(sketch,))) for each in found] == [False, True]
    assert five.is_wanted(State(best=found[0], curve=(sketch,))), "exactly as many maps as are asked for"
    better = replace(sketch, likeness=1.0)
    ended = [Promise(growth.problem).close(State(best=each, curve=(better,))).is_outgrown for each in found]
    assert ended == [False, True]


def test_a_code_that_renders_a_density_roughly_is_kept_with_another_number_of_maps_than_is_asked_for():
    code = attractor.normalize(random_suite(1, 5)[0])
    image, params = target(code, 64), CollageParams(maps=len(code) + 1)
    growth = Growth(SearchProblem(image, levels_of(image, "density", params.camera), params))
    near = Candidate(affine.from_code(code) * 0.95, None, 0.0, 0.0)
    assert growth.grower.likeness(near, growth.problem.camera_of(near)) < UNLIKE
    assert not growth.is_wanted(State(best=near))
