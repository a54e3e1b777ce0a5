"""The polish of codes: Jacobians and the frame."""

import math
from dataclasses import replace

import pytest
import torch
from collage_helpers import DENSITY, PARAMS, distances, image_search, objective, random

from fractal_exp import codes, suite
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.bins import binned
from fractal_exp.methods.collage.image.gauss_newton import polished
from fractal_exp.methods.collage.image.jacobian import FromPoints, FromRenderings, halved
from fractal_exp.methods.collage.image.objective import Frame
from fractal_exp.methods.collage.measure.births import reoriented, thinness
from fractal_exp.methods.collage.moves.reorient import with_reorientation
from fractal_exp.methods.collage.moves.search import ImageSearch
from fractal_exp.methods.collage.moves.single import THIN, small_maps
from fractal_exp.methods.collage.simplify.loop import Price, pruned_in_frame
from fractal_exp.methods.collage.state import Candidate


@pytest.fixture(scope="module")
def fern():
    """Barnsley's fern in the frame, and its grey image of 128²."""
    code = attractor.normalize(replace(codes.known("fern"), probabilities=None))
    return code, suite.target(code, 128)


def displaced(code, pixels=0.5, side=128):
    maps = affine.from_code(code)
    return maps + 2 * pixels / side * torch.randn(maps.shape, generator=torch.Generator().manual_seed(1)) / 2


@pytest.mark.parametrize("jacobian", [FromPoints, FromRenderings])
def test_both_jacobians_lead_to_the_true_code(triangle, jacobian):
    code, image = triangle
    picture = objective(image)
    start = picture.judge(displaced(code))
    found = polished(picture, start, 8, jacobian=jacobian)
    assert found.error < 0.3 * start.error
    assert jacobian(picture, start, [1], 0).square.shape == (6, 6)


@pytest.mark.slow
def test_renderings_lead_nearer_than_bins_where_images_end_at_the_edge_of_a_pixel(triangle):
    code, image = triangle
    before = after = 0.0
    for seed in range(4):
        picture = objective(image, seed=seed)
        by_bins = polished(picture, picture.judge(displaced(code, 0.05)), 10)
        before += by_bins.error
        after += polished(picture, by_bins, 4, jacobian=FromRenderings, alone=True).error
    assert after < 0.96 * before


def test_the_frame_is_that_of_targets_and_of_nothing_else(fern, triangle):
    for code, image in (fern, triangle):
        frame, maps = Frame.of(image, DENSITY, PARAMS.frame), affine.from_code(code)
        misfit = frame.misfit(maps, code.sampling_probabilities())
        assert misfit.shape == (3,) and float(misfit.abs().max()) < 0.02
    image = fern[1]
    assert Frame.of(torch.zeros_like(image), DENSITY, PARAMS.frame) is None
    assert Frame.of(torch.ones_like(image), DENSITY, PARAMS.frame) is None
    small = torch.zeros_like(image)
    small[32:96, 32:96] = image[::2, ::2]
    assert Frame.of(small, DENSITY, PARAMS.frame) is None


def test_the_slopes_of_a_misfit_are_its_differences(fern):
    code, image = fern
    frame, maps = Frame.of(image, DENSITY, PARAMS.frame), affine.from_code(code).double()
    probabilities = code.sampling_probabilities()
    slopes = frame.jacobian(maps, probabilities)
    direction = torch.randn(maps.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    step = 1e-4
    ends = [frame.misfit(maps + sign * step * direction, probabilities) for sign in (1, -1)]
    torch.testing.assert_close((ends[0] - ends[1]) / (2 * step), (slopes * direction).sum((1, 2)), rtol=0.02, atol=0.05)


def test_a_tip_nobody_sees_is_moved_into_the_frame(fern):
    code, image = fern
    stem = int(code.linear.det().abs().argmin())
    maps = affine.from_code(code)
    maps[stem, 5] += 0.02  # more than a pixel, of a tip that few points visit
    frame = Frame.of(image, DENSITY, PARAMS.frame)
    picture = objective(image).within(frame)
    start = picture.judge(maps)
    found = polished(picture, start, 8, patience=2)
    before, after = (float(frame.misfit(d.maps, d.probabilities).abs().max()) for d in (start, found))
    assert before > 1 and after < 0.5 * before


def test_the_stem_of_a_fern_is_a_line_and_its_fronds_are_none(fern):
    code, image = fern
    picture, stem = objective(image), int(code.linear.det().abs().argmin())
    jacobian = FromPoints(picture, picture.judge(affine.from_code(code)), [stem], 0)
    assert [i for i in range(len(code)) if jacobian.is_line(i)] == [stem]


@pytest.mark.parametrize("angle", [0, 30, 45, 90])
def test_a_shape_on_a_slanted_line_has_lines_for_maps(angle):
    turned = math.radians(angle)
    along = torch.tensor([math.cos(turned), math.sin(turned)])
    maps = torch.stack([torch.cat([torch.eye(2).flatten() / 3, sign * along / 2]) for sign in (-1, 1)])
    picture = objective(suite.target(affine.to_code(maps), 128))
    jacobian = FromPoints(picture, picture.judge(maps), [0], 0)
    assert [jacobian.is_line(i) for i in (0, 1)] == [True, True]


def test_only_a_line_is_polished_one_number_at_a_time(fern, monkeypatch):
    code, image = fern
    picture, stem, tried = objective(image), int(code.linear.det().abs().argmin()), []
    monkeypatch.setattr(FromPoints, "solve", lambda change, damping: torch.full_like(change.gradient, 40.0))
    monkeypatch.setattr(FromPoints, "solve_alone", lambda change: tried.append(change) or change.gradient * 0)
    shown = picture.judge(affine.from_code(code))
    for i in range(len(code)):
        assert polished(picture, shown, 1, [i]) is shown, "no step gains"
    assert [{i for i, _, _ in each.units} for each in tried] == [{stem}]


def test_a_line_is_reoriented_by_its_rendering(fern):
    code, image = fern
    maps, stem = affine.from_code(code), int(code.linear.det().abs().argmin())
    measure = binned(DENSITY.measure(image), 64)
    thin = [thinness(each, measure) for each in maps]
    assert thin[stem] < THIN < min(thin[:stem] + thin[stem + 1:])
    wrong = maps.clone()
    wrong[stem] = reoriented(maps[stem], measure, 1, torch.Generator().manual_seed(4))[0]
    search = image_search(image)
    shown = search.objective.judge(wrong)
    assert small_maps(shown, random(0)) == [stem], "the map that is chosen"
    found = with_reorientation(search, shown, random(0))
    assert found.error < shown.error


def test_the_last_polish_leaves_a_true_code_where_it_is(fern):
    code, image = fern
    true = affine.from_code(code)
    search = image_search(image)
    found = search.finish(search.candidate(search.objective.judge(true)))
    away = distances(found.maps, true, binned(DENSITY.measure(image), 64)).diagonal() * 64
    assert float(away.max()) < 0.1  # pixels of 128


def test_a_resumed_search_knows_weights_of_its_own_as_the_live_one_does(fern):
    code, image = fern
    maps = affine.from_code(code)
    picture = objective(image)
    fewer = picture.without(picture.judge(maps, torch.tensor([0.1, 0.5, 0.2, 0.2])), [3])
    for number in range(6):
        search, again = (ImageSearch(picture, DENSITY.measure(image), noise=0.1) for _ in range(2))
        now = search.candidate(fewer)
        live = search.step(now, number)
        resumed = again.step(Candidate(now.maps, now.weights, now.error, now.score), number)
        assert torch.equal(live.maps, resumed.maps) and torch.equal(live.probabilities, resumed.probabilities)


def test_a_polished_code_loses_what_neither_picture_nor_frame_asks_for(triangle):
    maps = torch.cat([affine.from_code(triangle[0]), torch.tensor([[0.01, 0, 0, 0.01, 0.2, 1.2]])])
    maps = affine.from_code(attractor.normalize(affine.to_code(maps)))  # the last map is a tip that decides the box
    picture = objective(suite.target(affine.to_code(maps), 128), maps=3)
    drawn = picture.judge(maps)
    price = 1.5 * (picture.without(drawn, [3]).error - drawn.error)
    blind = pruned_in_frame(picture, drawn, Price(price), near=False)
    assert torch.equal(blind.maps, maps[:3]) and blind.error == picture.judge(maps[:3]).error
    assert pruned_in_frame(picture, drawn, Price(price), near=True) is drawn
    asked = objective(picture.image, maps=4)
    assert pruned_in_frame(asked, drawn, Price(price), near=False) is drawn  # as many as there must be


@pytest.mark.parametrize("side", [6, 7])
def test_cells_are_halved_as_the_whole_grid_would_be(side):
    dense = torch.rand(3, side, side) * (torch.rand(side, side) < 0.4)
    cells = (dense != 0).any(0).flatten().nonzero().flatten()
    found, means = halved(cells, dense.flatten(1)[:, cells].T, side)
    expected = torch.nn.functional.avg_pool2d(dense, 2, ceil_mode=True).flatten(1)
    torch.testing.assert_close(torch.zeros_like(expected).index_copy(1, found, means.T), expected)
