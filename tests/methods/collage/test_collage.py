import subprocess
import sys
import time
from dataclasses import replace

import pytest
import torch
from collage_helpers import (
    DENSITY,
    PARAMS,
    check_it_goes_on,
    distances,
    interrupted,
    measure_search,
    problem,
    small,
    tied,
)
from ops_helpers import check_descent, check_pushforward, check_pushforward_gradients, numba_threads, tiling_problem

from fractal_exp import IFS, InputError, codes, suite
from fractal_exp.evaluation import evaluate
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.bins import binned, saturation_corrected
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.moves.search import ImageSearch
from fractal_exp.methods.collage.stages.image import ImageMoves
from fractal_exp.methods.collage.state import Candidate, State
from fractal_exp.ops.collage import BinnedMeasure, Descent, collage_error, descend, pushforward
from fractal_exp.runtime.checkpoint import Checkpoint

IDENTITY = torch.tensor([[[1.0, 0, 0, 1, 0, 0]]])


def test_a_search_of_a_grey_picture_loads_nothing_that_only_other_pictures_need():
    grey = "import sys, fractal_exp.methods.collage.method; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", grey], capture_output=True, text=True, check=True).stdout.split()
    names = {each.removeprefix("fractal_exp.") for each in loaded}
    assert {"methods.collage.stages.image", "cameras.levels"} <= names
    assert not names & {f"cameras.{each}" for each in ("pens", "linear", "strokes", "tiles")}
    collage = {each.removeprefix("methods.collage.") for each in names if each.startswith("methods.collage.")}
    assert not collage & {"image.camera", "image.counts", "measure.population", "moves.drawn", "stages.construction",
                          "stages.crossing", "stages.drawn", "stages.growth", "simplify.drawn", "simplify.parents",
                          "simplify.removal", "simplify.symmetry", "growth", "trees"}


def test_the_kernel_pushes_measures_forward_as_its_twin_does():
    check_pushforward("cpu")


def test_gradients_of_a_pushforward_are_those_of_the_twin():
    check_pushforward_gradients("cpu")
    check_pushforward_gradients("cpu", maps=1, samples=40, size=16)


def test_a_map_of_nan_leaves_the_canvas_nowhere():
    measure, maps, weights = tiling_problem()
    pushed = pushforward(torch.full_like(maps, torch.nan), weights, measure.samples, 32)
    torch.testing.assert_close(pushed.sum((1, 2)), torch.ones(4))


@pytest.mark.parametrize("options", [{}, {"tied": True}, {"smaller": 0.2}, {"largest": 0.4, "smaller": 0.3},
                                     {"beta_1": 0.5, "beta_2": 0.9, "epsilon": 1e-3}], ids=str)
@pytest.mark.parametrize("steps", [0, 1, 10])
def test_the_kernel_descends_as_its_twin_does(steps, options):
    check_descent("cpu", Descent(steps, rate=0.02, **options))


def test_the_kernel_and_its_twin_add_the_same_floor_to_masses():
    check_descent("cpu", Descent(3, rate=0.02), floor=1e-2)
    errors = [float(descend(maps, weights, measure, Descent(0))[2][0])
              for measure, maps, weights in (tiling_problem(floor=floor) for floor in (1e-5, 1e-2))]
    assert errors[1] < 0.5 * errors[0]


def test_the_smaller_singular_value_has_a_limit_of_its_own():
    measure, maps, weights = tiling_problem()
    moved = descend(maps, weights, measure, Descent(10, smaller=0.2))[0][weights > 0]
    assert float(affine.smaller_singular(moved).max()) < 0.2 + 1e-5 < 0.5 < float(affine.largest_singular(moved).max())


def test_descent_keeps_maps_contractive_and_off_the_identity():
    measure, _, _ = tiling_problem()
    how = Descent(100, rate=0.02, largest=0.9)
    maps, weights, _ = descend(IDENTITY.clone() * 0.99, torch.ones(1, 1), measure, how)
    assert float(affine.largest_singular(maps).max()) <= 0.9 + 1e-5


def test_a_true_code_has_no_collage_error_and_maps_near_it_find_back(triangle):
    code, image = triangle
    masses = DENSITY.measure(image)
    measure = binned(masses, 64)
    maps = affine.from_code(code)[None]
    weights = torch.full((1, 3), 1 / 3)
    _, _, error = descend(maps, weights, measure, Descent(0))
    assert float(error) < 0.01
    moved = maps + 0.06 * torch.randn(maps.shape, generator=torch.Generator().manual_seed(1))
    found, _, better = descend(moved, weights, measure, Descent(300, rate=0.01))
    assert float(better) < float(error) + 1e-3
    assert float(distances(found[0], maps[0], measure).diagonal().max()) < 1 / 64


def test_the_correction_brings_the_measure_of_a_saturated_image_back():
    code = attractor.normalize(suite.random_suite(6, 101)[5])  # nine of ten points fall where one was
    masses = DENSITY.measure(suite.target(code, 256))
    maps, weights = affine.from_code(code)[None], affine.volumes(affine.from_code(code))
    weights = (weights / weights.sum())[None]
    before, after = (float(descend(maps, weights, binned(m, 64), Descent(0))[2])
                     for m in (masses, saturation_corrected(masses, code, DENSITY, PARAMS.saturation, 3)))
    assert after < 0.5 * before


@pytest.mark.parametrize(("kind", "least"), [  # a binary picture carries no density
    ("grey", 0.9), pytest.param("binary", 0.6, marks=pytest.mark.slow)])
def test_the_triangle_is_found(triangle, kind, least):
    code, _ = triangle
    image = suite.target(code, 128, kind)
    found = small(search={"moves": 8, "detail_moves": 3}, moves={"count": 3}).reconstruct(image).code
    table = evaluate(found, code, resolution=128, align="none")
    assert table.f1.mean() > least


def test_the_code_does_not_depend_on_the_number_of_threads(triangle):
    image = suite.target(triangle[0], 256)   # of so many pixels, torch shares out a sum among its threads
    found, before = [], torch.get_num_threads()
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            with numba_threads(threads):
                found.append(small(search={"moves": 4}, moves={"count": 2}).reconstruct(image).code)
    finally:
        torch.set_num_threads(before)
    assert torch.equal(found[0].linear, found[1].linear) and torch.equal(found[0].offset, found[1].offset)


def test_a_candidate_beside_the_canvas_is_rendered_without_a_word(caplog):
    beside = IFS(torch.eye(2).expand(2, 2, 2) * 0.1, torch.full((2, 2), 5.0))
    assert not bool(DENSITY.render(beside, 64, 0).any()) and not caplog.records


def test_a_checkpoint_of_other_stages_is_refused(triangle):
    code, _ = triangle
    maps = affine.from_code(code)
    snapshot = State(best=Candidate(maps, affine.volumes(maps), 0.0)).snapshot()
    for numbers, version in (({"stages": 5}, 5), ({}, 1), ({"collage": 99}, 99)):
        other = replace(snapshot, numbers={k: v for k, v in snapshot.numbers.items() if k != "collage"} | numbers)
        with pytest.raises(InputError, match=f"got version {version}; start over with resume=false"):
            State.of(other, "cpu")


@pytest.fixture(scope="module")
def image(triangle):
    """The triangle at a size that makes a search take a second."""
    return suite.target(triangle[0], 48)


@pytest.fixture(scope="module")
def whole(image):
    """What a small search of the triangle tells from beginning to end, and the code that it returns."""
    told = []
    return told, small().reconstruct(image, on_step=told.append).code


def test_another_seed_goes_another_way(image, whole):
    """That one seed repeats is seen where a search goes on after an interruption."""
    first, *_ = interrupted(small(seed=1), image, lambda told: True)
    assert first.step == whole[0][0].step and first.scalars["score"] != whole[0][0].scalars["score"]


def test_candidates_are_told_until_the_first_stage_has_ended(whole):
    told, _ = whole
    first = next(number for number, progress in enumerate(told) if progress.code is not None)
    assert first > 0
    for progress in told[:first]:
        assert len(progress.candidate) == progress.scalars["maps"]
        progress.candidate.check_contractive()
    scores = [progress.scalars["score"] for progress in told[:first + 1]]
    assert scores == sorted(scores, reverse=True)
    assert torch.equal(told[first].code.linear, told[first - 1].candidate.linear)
    assert not any(progress.candidate for progress in told[first:])


def test_a_search_stopped_while_a_stage_begins_goes_on_bit_for_bit(image, whole, tmp_path, monkeypatch):
    path = tmp_path / "checkpoint.safetensors"

    def interrupt(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(ImageSearch, "resume", interrupt)
        with pytest.raises(KeyboardInterrupt):
            small().reconstruct(image, checkpoint=Checkpoint(path))
    resumed = small().reconstruct(image, checkpoint=Checkpoint(path, resume=True)).code
    assert torch.equal(whole[1].linear, resumed.linear)


def test_an_interrupted_search_tells_what_its_moves_have_found_with_its_camera(image):
    def is_second_move(told):
        return [each.stage for each in told[-2:]] == 2 * ["image"] and told[-1].code is None

    moved, _, last = interrupted(small(moves={"count": 2}), image, is_second_move)[-3:]
    assert moved.code is None and last.stage == "image" and last.code is not None
    assert last.scalars["error"] == moved.scalars["error"] and last.camera == DENSITY.camera


def test_weights_of_its_own_come_back_from_a_checkpoint_as_they_were():
    maps = torch.randn(4, 6, generator=torch.Generator().manual_seed(0)) * 0.3
    own = Candidate(maps, torch.tensor([0.7, 0.2, 0.07, 0.03]) * 1.7, 0.1)
    state = State.of(State(best=own, before=Candidate(maps, None, 0.1)).snapshot(), "cpu")
    assert torch.equal(state.best.weights, own.weights) and state.before.weights is None
    assert torch.equal(state.best.probabilities, own.probabilities)


@pytest.mark.parametrize(("name", "size"), [("sierpinski_triangle", 33), *(
    pytest.param("heighway_dragon", size, marks=pytest.mark.slow) for size in (32, 33))])
def test_small_and_odd_pictures_are_taken(name, size):
    image = suite.target(codes.known(name), size)
    brief = small(search={"restarts": 1, "moves": 1, "detail_moves": 1}, moves={"count": 1})
    assert len(brief.reconstruct(image).code) >= 2


@pytest.mark.parametrize("stop", [1, 10, *(pytest.param(stop, marks=pytest.mark.slow) for stop in (4, 8, 12))])
def test_a_search_interrupted_anywhere_goes_on_bit_for_bit(image, whole, tmp_path, stop):
    """In each island, the closing moves, the details, the picture."""
    def is_there(told):
        return told[-1].step >= stop and told[-1].code is None

    check_it_goes_on(small, image, is_there, tmp_path / "checkpoint", whole[1])


def test_the_number_of_maps_can_be_fixed_or_bounded(image):
    five = suite.target(codes.known("vicsek"), 48)
    assert len(small(maps=4, search={"moves": 12}).reconstruct(image).code) == 4
    assert len(small(at_most=3).reconstruct(five).code) <= 3


def test_time_ends_a_search_with_the_best_so_far(image):
    steps = []
    start = time.monotonic()
    endless = small(search={"moves": 10_000}, moves={"count": 10_000}, seconds=1)
    code = endless.reconstruct(image, on_step=steps.append).code
    assert time.monotonic() - start < 10 and len(steps) < 1000
    assert [p.fraction for p in steps] == sorted(p.fraction for p in steps)
    assert torch.equal(code.linear, [p for p in steps if p.code is not None][-1].code.linear)


def test_a_search_never_returns_a_worse_state(triangle):
    _, image = triangle
    search = measure_search(DENSITY.measure(image))
    now = search.start()
    for number in range(6):
        new = search.step(now, number)
        assert new.score <= now.score
        now = new


@pytest.mark.parametrize(("step", "settled", "reason"), [
    (2, True, "the code renders the image as well as the true one would"), (2, False, "no move helped any more"),
    (18, False, "all moves were made")])
def test_a_search_says_why_it_stopped(triangle, step, settled, reason):
    code, image = triangle
    stage, now = ImageMoves(problem(image, moves={"count": 6})), tied(affine.from_code(code))
    stage.open(State(best=now, current=now))
    stage.search.is_settled = lambda candidate, moves: settled
    after = stage.close(State(best=now, current=stage.search.judged(now), step=step))
    assert after.stopped == reason and State.of(after.snapshot(), "cpu").stopped == reason


def test_each_stage_tells_its_code_and_the_last_is_returned(whole):
    told, found = whole
    ends = [p for p in told if p.code is not None]
    assert [p.stage for p in ends] == ["search", "search", "detail", "image", "rounding"]
    assert torch.equal(ends[-1].code.linear, found.linear)
    assert [p.fraction for p in told] == sorted(p.fraction for p in told) and told[-1].fraction == 1
    assert ends[2].fraction == pytest.approx(11 / 13), "moves beyond those asked for are not expected"
    assert [p.step for p in told] == sorted(p.step for p in told)


def test_mixing_searches_takes_the_right_maps_from_each(triangle):
    code, image = triangle
    search = measure_search(DENSITY.measure(image))
    true = affine.from_code(code)
    wrong = affine.sending(affine.random_matrices(12, 0.2, 0.6, 0.05, torch.Generator().manual_seed(1)),
                           torch.zeros(12, 2), torch.zeros(12, 2))
    mixed = search.mixed(torch.cat([wrong[:6], true[:2], wrong[6:], true[2:]]), tied(wrong))
    near = distances(true, mixed.maps, search.measure).min(1).values * 64
    assert bool((near < 1).all()) and len(mixed.maps) < 6


@pytest.mark.parametrize(("options", "message"), [
    ({"search": {"moves": -1}}, "search.moves must be at least 0, got -1"), ({"maps": 1}, "maps must be at least 2"),
    ({"seconds": 0}, "seconds must be above 0"), ({"refine": {"finest": 8}}, "refine.finest must be at least 128"),
    ({"move": {}}, "there is no parameter move; did you mean 'moves'"),
    ({"seconds": "a"}, "seconds must be above 0 .* got 'a'; give a number, such as 60"),
    ({"seconds": float("nan")}, "seconds must be above 0"),
    ({"previews": -1}, "previews must be an integer of at least 0"),
])
def test_bad_options_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        Collage(**options)


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="at least 32"):
        Collage().reconstruct(torch.eye(16))
    with pytest.raises(InputError, match="maps must have shape"):
        pushforward(torch.zeros(3, 6), torch.zeros(3), torch.zeros(1, 3), 8)
    with pytest.raises(InputError, match="halved"):
        BinnedMeasure(torch.zeros(1, 3), torch.zeros(10, 10), 3)
    with pytest.raises(InputError, match="backend must be one of"):
        pushforward(IDENTITY, torch.ones(1, 1), torch.zeros(1, 3), 8, backend="tpu")
    with pytest.raises(InputError, match="samples must have shape"):
        BinnedMeasure(torch.zeros(3), torch.zeros(8, 8), 1)


def test_the_error_of_a_measure_with_itself_is_zero():
    measure, _, _ = tiling_problem()
    assert float(collage_error(measure.bins[None], measure)) == pytest.approx(0, abs=1e-9)
