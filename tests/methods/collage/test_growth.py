"""Shapes of no code: pavings, growth, the curve of likeness over maps, and the choice from it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from collage_helpers import merged, objective, tied
from PIL import Image, ImageDraw

from fractal_exp.cameras.estimate import estimated
from fractal_exp.cameras.kinds import levels_of
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import decided
from fractal_exp.methods.collage.growth import growing
from fractal_exp.methods.collage.growth.coverage import areas
from fractal_exp.methods.collage.growth.growing import Grower
from fractal_exp.methods.collage.growth.paving import paving
from fractal_exp.methods.collage.growth.silhouette import Silhouette
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.pipeline import Pipeline
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.growth import UNLIKE, Growth
from fractal_exp.methods.collage.stages.plan import plan_of
from fractal_exp.methods.collage.state import Key, State
from fractal_exp.runtime.checkpoint import Checkpoint
from fractal_exp.runtime.deadline import Deadline
from fractal_exp.runtime.seeds import generator
from fractal_exp.suite import random_suite, target

FEW = {"counts": (6, 12), "usual": 18, "steps": 30}
BLOB = torch.tensor([[0.0, -0.9, 0.92, 0, 0.1, 0], [0.92, 0, 0, 0.9, 0, 0.01]])   # turns that hardly contract


def drawn(lines: list[tuple], width: int, side: int = 96) -> torch.Tensor:
    image = Image.new("L", (4 * side, 4 * side))
    for line in lines:
        ImageDraw.Draw(image).line([4 * side * each for each in line], 255, 4 * width, joint="curve")
    return torch.from_numpy(np.asarray(image.resize((side, side), Image.Resampling.BOX)).astype(np.float32) / 255)


BRANCH = drawn([(0.5, 0.9, 0.5, 0.5), (0.5, 0.5, 0.2, 0.15), (0.5, 0.55, 0.85, 0.2), (0.35, 0.32, 0.15, 0.4),
                (0.67, 0.4, 0.6, 0.15)], 3)
LETTER = drawn([(0.2, 0.2, 0.8, 0.2), (0.5, 0.2, 0.45, 0.85), (0.3, 0.8, 0.7, 0.8)], 12)


def grower(image: torch.Tensor, **growth) -> Grower:
    params = CollageParams().updated(growth={**FEW, **growth})
    return Grower(image, params)


def stage(image: torch.Tensor, seconds: float | None = None, levels: str = "auto", **options) -> Growth:
    params = CollageParams().updated(**merged({"growth": FEW}, options))
    seen = levels_of(image, decided(levels, image), params.camera)
    return Growth(SearchProblem(image, seen, params, deadline=Deadline(seconds)), 2)


def run(image: torch.Tensor, **options) -> tuple[State, list[str]]:
    """The state after a search that ended with a blob, and the stages that came after."""
    told = []
    some = stage(image, **merged({"rounding": {"enabled": False}}, options))
    done = State(done=Key(some.problem.rounds, "rounding"), best=tied(BLOB))
    pipeline = Pipeline(plan_of(some.problem), done, on_move=lambda *_: None,
                        on_stage=lambda each, _: told.append(each.name))
    pipeline.run()
    return pipeline.state, told


def test_f1_within_a_pixel_forgives_a_pixel_and_no_more():
    truth = torch.zeros(16, 16, dtype=torch.bool)
    truth[4:8, 4:8] = True
    shares = [Silhouette(truth).likeness(truth.roll(shift, 1).float()) for shift in range(7)]
    assert shares == pytest.approx([1, 1, 0.75, 0.5, 0.25, 0, 0])
    assert Silhouette(truth).likeness(torch.zeros(truth.shape)) == 0
    assert Silhouette(truth & False).likeness(torch.zeros(truth.shape)) == 1


@pytest.mark.parametrize("image", [BRANCH, LETTER], ids=["thin", "thick"])
def test_a_paving_covers_the_shape_the_better_the_more_maps_it_has(image):
    some = grower(image)
    few, more, most = (some.plain(count) for count in (4, 16, 64))
    assert [len(each.maps) for each in (few, more, most)] == [4, 16, 64]
    assert few.likeness + 0.05 < more.likeness < most.likeness and most.likeness > 0.93


def test_a_shape_of_fewer_pixels_than_maps_is_paved_too():
    mask = torch.zeros(32, 32, dtype=torch.bool)
    mask[10, 10] = mask[20, 12] = mask[20, 13] = True
    found = paving(Silhouette(mask), 5)
    assert found.shape == (5, 6) and bool(found.isfinite().all())
    assert float(affine.largest_singular(found).max()) < 1


def test_a_knob_at_the_end_of_a_line_is_paved_by_maps_that_contract():
    mask = torch.zeros(64, 64, dtype=torch.bool)
    mask[32, 4:60] = True
    mask[28:37, 54:63] = True                             # its shorter axis is longer than that of the whole
    found = paving(Silhouette(mask), 3)
    assert float(affine.largest_singular(found).max()) == pytest.approx(0.9, abs=1e-5)
    assert len(grower(mask.float()).grown(3).maps) == 3


def test_areas_are_those_of_the_images_in_pixels():
    mask = torch.zeros(64, 64, dtype=torch.bool)
    mask[16:48, 16:48] = True                             # the square from -0.5 to 0.5
    maps = torch.tensor([[0.5, 0, 0, 0.5, 0.1, 0.2], [0.5, 0, 0, 0, 0, 0.01]])
    square, line = areas(maps, Silhouette(mask), generator(0, "areas")).tolist()
    assert square == pytest.approx(16 * 16) and line == pytest.approx(16 / 16, rel=0.05)


@pytest.mark.parametrize("image", [BRANCH, LETTER], ids=["thin", "thick"])
def test_grown_maps_are_better_than_a_paving_with_as_many(image):
    some = grower(image)
    paved, found = some.plain(12), some.grown(12, some.grown(6))
    assert len(found.maps) == 12 and 1 - found.likeness < 0.6 * (1 - paved.likeness)
    assert found.likeness == some.likeness(found), "of what is drawn"


def test_a_refinement_that_goes_wrong_leaves_the_paving(monkeypatch):
    some = grower(BRANCH)
    monkeypatch.setattr(growing, "covering", lambda maps, *_: maps * 0.5)
    assert torch.equal(some.grown(8).maps, some.plain(8).maps)


def test_so_many_maps_are_grown_as_asked_for_and_the_curve_is_kept():
    found = Collage(maps=24, growth={**FEW, "counts": (6, 12, 48)}).reconstruct(BRANCH)
    assert len(found.code) == 24 and [each.maps for each in found.curve] == [6, 12, 24]
    assert [each.bytes for each in found.curve] == [72, 144, 288]
    likeness = [each.likeness for each in found.curve]
    assert likeness == sorted(likeness) and likeness[-1] > 0.9
    assert torch.equal(found.curve[-1].code.linear, found.code.linear)
    assert found.stopped.startswith("24 maps were grown, F1 0.9")


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
    assert grower(image).likeness(right) < UNLIKE   # of the brighter pixels alone
    assert not stage(image).is_wanted(State(best=right))
    assert stage(image, likeness=0.99).is_wanted(State(best=right))
    assert stage(image).is_wanted(State(best=tied(BLOB)))


def test_what_was_found_stays_unless_grown_maps_draw_the_picture_better():
    some = stage(BRANCH)
    few, many = some.grower.plain(6), some.grower.grown(18)
    promised = replace(few, likeness=2.0)                 # beyond what any drawing has
    for curve in ((few,), (promised,)):
        kept = some.close(State(best=replace(tied(many.maps), weights=many.weights), curve=curve))
        assert torch.equal(kept.result.maps, many.maps)
    grown = some.close(State(best=replace(tied(few.maps), weights=few.weights), curve=(many,)))
    assert torch.equal(grown.result.maps, many.maps)


def test_grown_maps_get_a_camera_that_shows_them():
    g = torch.Generator().manual_seed(3)
    picture = (LETTER > 0.5) & (torch.rand(LETTER.shape, generator=g) < 0.3)   # sparse dots of one grey level
    picture = 0.6 * picture.float()
    some = stage(picture, levels="dots")
    grown = some.grower.grown(18)
    shown = some.close(State(best=tied(BLOB), curve=(grown,))).result

    def likeness(camera) -> float:
        judge = some.problem.objective(len(picture), grown.code, 0, camera=camera)
        return judge.likeness(judge.judge(grown.maps, grown.weights).image)

    nearest = estimated(picture, some.problem.levels, grown.code, 0)
    assert likeness(nearest) < 0.5, "too faint to be seen"
    assert likeness(shown.camera) > 0.95 and shown.camera.kind == "dots"


def test_what_draws_a_binary_image_with_less_error_stays():
    truth = attractor.normalize(random_suite(67)[4])
    image = target(truth, 128, "binary")
    some = stage(image)
    grown = replace(some.grower.plain(6), likeness=1.0)
    right = affine.from_code(truth)
    assert torch.equal(some.close(State(best=tied(right), curve=(grown,))).result.maps, right)
    assert torch.equal(some.close(State(best=tied(BLOB), curve=(grown,))).result.maps, grown.maps)
    asked = stage(image, likeness=0.99)
    assert torch.equal(asked.close(State(best=tied(right), curve=(grown,))).result.maps, grown.maps)


def test_however_late_it_is_there_is_a_paving_at_least():
    some = stage(BRANCH, seconds=1e-6)
    state = State(best=tied(BLOB))
    assert some.is_wanted(state) and not some.deadline.passed and some.counts == [18]
    after = some.close(some.move(some.open(state)))
    assert torch.equal(after.result.maps, some.grower.plain(18).maps)


def test_growth_goes_on_where_it_was_interrupted(tmp_path, monkeypatch):
    path, options = tmp_path / "growth.safetensors", {"maps": 24, "growth": {**FEW, "steps": 5}}
    whole = Collage(**options).reconstruct(BRANCH)
    move = Growth.move

    def interrupted(stage, state):
        if state.step == 1:
            raise KeyboardInterrupt
        return move(stage, state)

    with monkeypatch.context() as patch:
        patch.setattr(Growth, "move", interrupted)
        with pytest.raises(KeyboardInterrupt):
            Collage(**options).reconstruct(BRANCH, checkpoint=Checkpoint(path))
    resumed = Collage(**options).reconstruct(BRANCH, checkpoint=Checkpoint(path, resume=True))
    assert torch.equal(whole.code.linear, resumed.code.linear) and torch.equal(whole.code.offset, resumed.code.offset)
    assert [each.likeness for each in whole.curve] == [each.likeness for each in resumed.curve]


def test_a_code_keeps_its_likeness_in_two_bytes_a_number():
    some = grower(BRANCH)
    found = some.grown(18)
    rounded = torch.round(found.maps * 2**14) / 2**14
    assert some.drawn(rounded).likeness > found.likeness - 0.02
