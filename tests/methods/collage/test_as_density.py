"""The search on a picture that may be a density: dots, or behind a tone curve."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import UNPOLISHED, dot_camera, pen_camera, tied

from fractal_exp import codes
from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.estimate import DOTTED, estimated, nearest
from fractal_exp.cameras.kinds import levels_of, with_camera
from fractal_exp.cameras.levels import FAINT, Density, may_be_density
from fractal_exp.cameras.pens import Dots, Inked, ToneMapped
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.known import Known
from fractal_exp.images.levels import DRAWN, meaning_of
from fractal_exp.likeness import likeness_of_attractor
from fractal_exp.methods.collage.bins import correction
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.stages import plan_of
from fractal_exp.methods.collage.stages.base import SPLIT, SearchProblem
from fractal_exp.methods.collage.stages.construction import Construction
from fractal_exp.methods.collage.stages.drawn import AsDensity, DrawnMoves
from fractal_exp.methods.collage.stages.growth import Sketch
from fractal_exp.methods.collage.stages.image import Approach
from fractal_exp.methods.collage.stages.measure import Detail, FromMixture, Restart
from fractal_exp.methods.collage.state import Candidate, State
from fractal_exp.runtime.deadline import Deadline

SIDE, PARAMS = 128, CollageParams()
CAMERA = PARAMS.camera
CURVE = Camera("tonemapped")
FERN = attractor.normalize(codes.known("fern"))
CURVED = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(0.04, 0.0)).render(FERN, SIDE, 1) ** (1 / 2.2)
GASKET = attractor.normalize(codes.known("sierpinski_triangle"))
DRAWING = Inked(CAMERA, torch.zeros(SIDE, SIDE), pen_camera(0.0, 2 / SIDE, 0.0)).render(GASKET, SIDE, 1)


def problem(image=CURVED, levels=DRAWN, kind=SearchProblem, **options):
    params = PARAMS.updated(**options)
    return kind(image, levels_of(image, levels, params.camera), params)


def measured(given):
    return [stage.measured.kind for stage in AsDensity.all_of(given)]


def as_density(given):
    return AsDensity(given, CURVE.kind, 0.5)


def kinds(given, number=0):
    return [type(stage) for stage in plan_of(given).rounds[number]]


def test_a_density_is_grey_inside_and_a_drawing_is_not():
    koch = attractor.normalize(codes.known("koch_curve"))
    thin = Inked(CAMERA, torch.zeros(SIDE, SIDE), pen_camera(0.0, 0.5 / SIDE, 1 / SIDE)).render(koch, SIDE, 1)
    assert float((thin[thin > FAINT] < 0.95).float().mean()) > 0.9, "a thin line is grey"
    assert may_be_density(CURVED)
    assert not may_be_density(DRAWING) and not may_be_density(thin)
    speckled = 0.96 * DRAWING + 0.04 * torch.rand(SIDE, SIDE, generator=torch.Generator().manual_seed(0))
    assert not may_be_density(speckled), "noise near black and white is no grey"


def test_only_the_first_round_of_such_a_picture_searches_it_as_a_density_too():
    assert kinds(problem())[:5] == [Sketch, Restart, AsDensity, AsDensity, Restart]
    stages = plan_of(problem()).rounds[0][1:]
    places = [stage.key.place for stage in stages]
    assert places == sorted(set(places)) and [stage.restart for stage in stages[:4]] == [0, 1 / 3, 2 / 3, 1]
    assert AsDensity not in kinds(problem(), 1) + kinds(problem(DRAWING))
    for options in ({"levels": "coverage"}, {"camera": {"estimate": False}}):
        assert AsDensity not in kinds(problem(**options)), options
    assert measured(problem(camera={"curves": False})) == ["dots"]


def test_what_dots_fill_is_searched_as_their_density():
    """White dots that lie as densely as in a scatter plot: white inside, and grey on the grid of the search."""
    dots = (torch.rand(SIDE, SIDE, generator=torch.Generator().manual_seed(0)) < 0.6).float()
    disc = (torch.cartesian_prod(*2 * [torch.linspace(-1, 1, SIDE)]).norm(dim=1) < 0.7).view(SIDE, SIDE)
    plot = dots * disc
    assert not may_be_density(plot) and not may_be_density(disc.float())
    assert measured(problem(plot)) == ["dots"] and measured(problem(disc.float())) == []
    masses = Dots(CAMERA, plot).measure(plot)
    inside = masses[SIDE // 4:-SIDE // 4, SIDE // 4:-SIDE // 4].mean()
    torch.testing.assert_close(inside, -torch.tensor(0.4).log(), rtol=0.03, atol=0)


def test_a_restart_on_another_measure_does_not_begin_late():
    seconds = [0.0]
    given = replace(problem(), deadline=Deadline(100, lambda: seconds[0]))
    seconds[0] = 50
    assert [stage(given).latest_start.passed for stage in (Restart, as_density)] == [False, True]


@pytest.mark.parametrize("is_better", [True, False])
def test_the_search_stays_with_the_measure_whose_code_explains_the_picture_better(is_better):
    true, wrong = (Candidate(affine.from_code(code), None, 0.1, score)
                   for code, score in ((FERN, 3.0), (FERN.similar(0.7, (0.1, 0.1)), 1.0)))
    now, leader = (true, wrong) if is_better else (wrong, true)
    state = State(current=now, best=leader, pool=leader.maps, scores=(leader.score,))
    after = as_density(problem()).close(state)
    assert (after.measured_through == CURVE) == is_better and after.best is true
    assert after.scores == (true.score,), "scores on different measures cannot be compared"
    assert len(after.pool) == (8 if is_better else 4)
    assert State.of(after.snapshot(), "cpu").measured_through == after.measured_through


def test_later_stages_search_what_the_state_says():
    given, curve = problem(), ToneMapped(CAMERA, CURVED)
    assert torch.equal(given.masses_of(0, CURVE), curve.measure(CURVED))
    assert torch.equal(given.masses_of(0), given.masses)
    errors = []
    for measured in (None, CURVE):
        stage = Restart(given, 0, 0)
        errors.append(stage.open(State(measured_through=measured)).now.error)
    assert errors[0] != errors[1]


def test_where_a_picture_is_grey_inside_the_camera_that_explains_it_best_is_chosen():
    image = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(0.16, 0.0)).render(FERN, SIDE, 1) ** (1 / 1.25)
    dots, curve = (nearest(image, kind(CAMERA, image), FERN, 0)[0][0] for kind in (Dots, ToneMapped))
    assert DOTTED * dots < curve < dots
    levels = levels_of(image, meaning_of(image), CAMERA)
    assert may_be_density(image)
    for each in levels, with_camera(levels, CURVE):
        assert estimated(image, each, FERN, 0).kind == "tonemapped"


def test_no_tiles_copy_what_is_grey_inside_for_a_wrong_code():
    leaf, dragon = (attractor.normalize(codes.known(name)) for name in ("maple_leaf", "twindragon"))
    plot = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(0.1, 0.0)).render(leaf, SIDE, 1)
    tiles, dots = (nearest(plot, kind(CAMERA, plot), dragon, 0)[0] for kind in (Inked, Dots))
    assert tiles[1].tile and tiles[0] < dots[0], "they copy the picture best"
    assert estimated(plot, levels_of(plot, DRAWN, CAMERA), dragon, 0).kind == "dots"


def test_faint_pixels_of_a_density_belong_to_its_shape():
    image = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(0.01, 0.0)).render(FERN, SIDE, 1) ** (1 / 2.2)
    curve = Camera("tonemapped", gain=0.01, gamma=2.2, blur=0.0)
    for levels in ToneMapped(CAMERA, image, curve), Dots(CAMERA, image, dot_camera(0.01, 0.0)):
        assert likeness_of_attractor(FERN, image, levels) > 0.95
    drawn = Inked(CAMERA, image, pen_camera(0.0, 1 / SIDE, 0.0))
    assert likeness_of_attractor(FERN, image, drawn) < 0.95, "only what is a quarter white is of a drawing"


def test_a_resumed_search_keeps_its_measure():
    best = Candidate(affine.from_code(FERN), None, 0.1, 1.0)
    after = {}
    for measured in (None, CURVE):
        for is_resumed in (False, True):
            state = State(best=best, measured_through=measured)
            stage = Detail(problem(), 0)
            opened = stage.open(State.of(state.snapshot(), "cpu") if is_resumed else state)
            after[measured, is_resumed] = opened.now.error
        assert after[measured, False] == after[measured, True]
    assert after[None, True] != after[CURVE, True]


def test_the_masses_of_a_large_picture_are_those_of_its_density():
    large = CURVED.repeat_interleave(2, 0).repeat_interleave(2, 1)
    large[1::2] = 0  # half of the light: as a density, half of the mass
    given = problem(large, stages={"largest_side": SIDE})
    assert given.image.shape == CURVED.shape
    curve = ToneMapped(CAMERA, CURVED)
    masses = given.masses_of(0, CURVE)
    torch.testing.assert_close(masses, curve.measure(CURVED) / 2, rtol=0.02, atol=1e-3)


def test_a_tone_curve_makes_no_difference_to_the_correction_for_saturation():
    factors = [correction(levels.measure(levels.render(FERN, SIDE, 5)), FERN, levels, PARAMS.saturation, 0)
               for levels in (ToneMapped(CAMERA, CURVED), Density(CAMERA, CURVED))]
    torch.testing.assert_close(*factors, rtol=0.02, atol=0.02)


@pytest.mark.parametrize("kind", [Approach, DrawnMoves])
def test_the_camera_is_estimated_for_the_measure_of_the_search(kind):
    measures = []

    class Asked(SearchProblem):
        def camera(self, code, measured_through=None):
            measures.append(measured_through)
            return Camera("coverage")

    given = problem(kind=Asked, **UNPOLISHED)
    for measure in (None, CURVE):
        best = Candidate(affine.from_code(FERN), None, 0.1, 1.0)
        kind(given).open(State(best=best, measured_through=measure))
    assert list(dict.fromkeys(measures)) == [None, CURVE]


def test_no_strokes_are_sought_in_a_density():
    given, far = problem(), Candidate(affine.from_code(FERN.similar(0.5, (0.0, 0.0))), None, 0.1, 1.0)
    assert Construction(given).is_wanted(State(best=far))
    assert not Construction(given).is_wanted(State(best=far, measured_through=CURVE))


def part(**options):
    """A problem whose image shows a part of a shape."""
    given = problem(**options)
    return replace(given, levels=given.levels.within(Known(left=-1.0, bottom=-1.0, right=0.3, top=1.0)))


def test_a_part_has_more_and_shorter_restarts_on_each_measure_that_it_may_show():
    options = {"search": {"restarts": 300, "moves": 50}, "rounds": 2}
    whole, cut = ([each for stages in plan_of(given).rounds for each in stages if isinstance(each, Restart)]
                  for given in (problem(**options), part(**options)))
    assert {each.expected_moves for each in whole} == {50} and {each.expected_moves for each in cut} == {13}
    assert len(cut) == SPLIT * len(whole) and sum(isinstance(each, AsDensity) for each in cut) == 2 * SPLIT
    assert [each.key for each in cut] == sorted((each.key for each in cut), key=lambda key: key.place)
    assert len({(each.stream, getattr(each, "measured", None)) for each in cut}) == len(cut), "a search is repeated"


def test_restarts_of_a_part_do_not_end_because_two_agree():
    stages = [Restart(given, restart=2) for given in (problem(), part())]
    agreeing = State(best=replace(tied(affine.from_code(FERN).float()), score=0.5), scores=(0.5, 0.5))
    assert [stage.is_wanted(agreeing) for stage in stages] == [False, True]


def test_the_time_of_a_part_goes_to_the_stages_on_its_measure_but_others_begin_in_time():
    given = replace(part(stages={"largest_side": 64}), deadline=Deadline(60, lambda: 0.0))
    ends, whole = ({type(stage): stage.deadline.seconds for stage in plan_of(each).rounds[0]}
                   for each in (given, replace(problem(), deadline=given.deadline)))
    in_order = [ends[each] for each in (Restart, FromMixture, Detail, Approach, DrawnMoves)]
    assert in_order == sorted(in_order)
    assert ends[Detail] > whole[Detail] and ends[DrawnMoves] == whole[DrawnMoves]


def test_a_part_is_not_searched_for_a_construction_that_would_have_to_be_whole():
    drawing = problem(DRAWING)
    known = Known(left=-1.0, bottom=-1.0, right=0.3, top=1.0)
    assert Construction.may_help(drawing)
    assert not Construction.may_help(replace(drawing, levels=drawing.levels.within(known)))


def test_a_search_that_is_cut_short_returns_the_camera_of_its_code():
    found = Collage(seconds=1e-6, growth={"enabled": False}).reconstruct(CURVED)
    assert found.stopped.endswith("was reached") and found.camera.is_known
