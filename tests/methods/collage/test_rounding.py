"""Rounding: simple numbers, lines along the axes, symmetric offsets, the frame filled exactly."""

import math
from dataclasses import replace

import pytest
import torch
from collage_helpers import objective, problem

from fractal_exp import codes, suite
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.image.gauss_newton import polished
from fractal_exp.methods.collage.simplify.rounding import begun, rounded
from fractal_exp.methods.collage.simplify.simple_maps import (
    OFF_MIDDLE,
    RENDERED,
    Spread,
    mirrored_offsets,
    simple_matrices,
)
from fractal_exp.methods.collage.stages import plan_of
from fractal_exp.methods.collage.state import Candidate, State
from fractal_exp.runtime.deadline import Deadline


def pictured(code, side=128):
    code = attractor.normalize(replace(code, probabilities=None))
    return affine.from_code(code).float(), objective(suite.target(code, side), renderings=2)


def off(maps, pixels, side=128):
    return maps + 2 * pixels / side * torch.randn(maps.shape, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize("matrix", [
    [[0.42, -0.42], [1 / 3, 0.07]],
    [[math.cos(math.radians(36)) * 0.381966, -math.sin(math.radians(36)) * 0.381966],
     [math.sin(math.radians(36)) * 0.381966, math.cos(math.radians(36)) * 0.381966]],
    [[0.5, math.sqrt(3) / 6], [math.sqrt(3) / 6, -0.5]],
])
def test_simple_matrices_are_found_beside_them(matrix):
    true = torch.tensor(matrix, dtype=torch.float64)
    found = simple_matrices(true + torch.tensor([[1e-3, -1e-3], [5e-4, -5e-4]]), RENDERED.denominators)
    assert found.shape == (3, 2, 2)
    assert float((found - true).abs().amax((1, 2)).min()) < 1e-6


def test_a_code_of_simple_numbers_gets_them(triangle):
    maps, picture = pictured(triangle[0])
    start = picture.judge(off(maps, 0.02))
    found = rounded(begun(picture, start)).shown
    assert torch.equal(found.maps[:, :4], maps[:, :4].round(decimals=2))
    assert found.error < 0.5 * start.error
    assert found.maps[0, 4] == -found.maps[1, 4] and abs(float(found.maps[2, 4])) <= OFF_MIDDLE


def test_a_code_of_the_suite_keeps_its_numbers_and_fills_its_frame():
    maps, picture = pictured(suite.random_suite(1, 101)[0])
    start = picture.judge(maps * (1 + 1e-4))
    found = rounded(begun(picture, start)).shown
    assert all(float((simple_matrices(one, RENDERED.denominators) - one).abs().amax((1, 2)).min()) > 1e-5
               for one in found.maps[:, :4].unflatten(1, (2, 2)))
    assert torch.allclose(found.maps, maps, atol=2e-3)
    frame = picture.own_frame()
    before, after = (float(frame.misfit(drawn.maps, drawn.probabilities).abs().max()) for drawn in (start, found))
    assert after < 0.003 < before
    assert found.error < 1.02 * start.error


def test_what_is_near_to_simple_numbers_stays_where_the_image_tells(triangle):
    code = replace(triangle[0], linear=triangle[0].linear * 0.985)
    maps, picture = pictured(code)
    start = picture.judge(maps)
    spread = Spread.of(start, picture)
    assert spread.rounded(maps[0]) is None
    assert replace(spread, precision=replace(RENDERED, near_px=2.0)).rounded(maps[0]) is not None
    found = rounded(begun(picture, start)).shown
    assert float((found.maps - maps).abs().max()) < 1e-3


def test_a_stem_becomes_a_line_along_its_axis():
    maps, picture = pictured(codes.known("fern"))
    crooked = maps.clone()
    crooked[0] = torch.tensor([-0.0003, -0.0013, 0.0605, 0.1957, maps[0, 4] + 0.0004, -0.604])
    start = picture.judge(crooked)
    found = rounded(begun(picture, start)).shown
    stem = found.maps[0, :4]
    assert int((stem != 0).sum()) == 1 and bool((stem[:2] == 0).all())
    assert found.error < start.error
    assert torch.allclose(found.maps[1:, :4], maps[1:, :4], atol=1e-6)


@pytest.mark.slow
def test_dust_on_the_edges_of_pixels_is_moved_to_their_better_side():
    maps, picture = pictured(codes.known("cantor_dust"), 256)
    start = picture.judge(off(maps * (1 - 3e-4), 0.003, 256))
    found = rounded(begun(picture, start)).shown
    assert torch.allclose(found.maps[:, :4], maps[:, :4], atol=1e-7)
    assert found.maps[:, 4:].abs().unique().numel() <= 2
    assert found.error < 0.1 * start.error


@pytest.mark.parametrize(("scale", "end"), [
    pytest.param(0.51, -0.3755, marks=pytest.mark.slow), (0.5, -0.376),
    pytest.param(0.49, -0.378, marks=pytest.mark.slow)])
def test_a_stem_whose_end_is_not_seen_fills_the_frame(scale, end):
    maps, picture = pictured(codes.known("tree"))
    crooked = off(maps, 0.01)
    crooked[0] = torch.tensor([5e-4, 1e-4, -3e-4, scale, 3e-4, end])
    start = picture.judge(crooked)
    found = rounded(begun(picture, start)).shown
    frame = picture.own_frame()
    before, after = (float(frame.misfit(drawn.maps, drawn.probabilities).abs().max()) for drawn in (start, found))
    assert after < 0.002 < 0.04 < before
    assert found.error < 0.1 * start.error


def test_lines_are_none_of_maps_with_wide_images(triangle):
    maps, picture = pictured(triangle[0])
    spread = Spread.of(picture.judge(maps), picture)
    assert not list(spread.lines(maps[0]))
    upright = torch.tensor([0, 0, 0.001, 0.4, 0.0005, 0.1])
    lines = list(spread.lines(upright))
    assert all(line.one[0] == line.one[1] == 0 and line.scale in (2, 3) for line in lines)
    across = [float(line.one[4]) / OFF_MIDDLE for line in lines]
    assert {round(each) for each in across if abs(each) < 2} == {-1, 1}


def test_no_line_or_rounding_is_proposed_that_does_not_contract():
    spread = torch.diag(torch.tensor([1e-4, 0.1], dtype=torch.float64))
    tall = Spread(torch.zeros(2, dtype=torch.float64), spread, 2 / 256, RENDERED)
    lines = list(tall.lines(torch.tensor([0, 0.001, 0, 0.9, 0, 0])))
    assert lines and all(float(line.one[:4].abs().max()) < 1 for line in lines)
    assert all(line.scale == 3 for line in lines)  # the width is too little to be stretched that far
    flat = replace(tall, covariance=spread * torch.tensor([0, 1]))
    assert all(bool(line.one.isfinite().all()) for line in flat.lines(torch.tensor([0, 0.001, 0, 0.9, 0, 0])))
    wide = replace(tall, covariance=0.1 * torch.eye(2, dtype=torch.float64))
    assert wide.rounded(torch.tensor([0.9799, 0.1999, -0.1999, 0.9799, 0, 0])) is None


def test_fixed_entries_stay_while_others_are_polished(triangle):
    maps, picture = pictured(triangle[0])
    start = picture.judge(off(maps, 0.3))
    fixed = {(0, 0), (0, 1), (2, 2), (2, 3), (2, 5)}
    found = polished(picture, start, 4, fixed=fixed)
    moved = found.maps != start.maps
    assert found.error < start.error
    assert not any(moved[i, j] for i, j in fixed) and int(moved.sum()) == 13


@pytest.mark.parametrize("kind", ["grey", "binary"])
def test_the_last_stage_ends_the_work_and_keeps_codes_that_are_far_off(triangle, kind):
    image = suite.target(triangle[0], 128, kind)
    given = problem(image)
    for pixels, kept in ((0.02, False), (5, True)):
        maps = off(affine.from_code(triangle[0]).float(), pixels)
        stage, found = plan_of(given).last[-1], Candidate(maps, None, 0.0)
        done = stage.close(stage.open(State(best=found, before=found)))
        assert stage.name == "rounding" and done.before is None
        assert torch.equal(done.result.maps, maps) == kept


def test_nothing_is_rounded_when_time_is_up(triangle):
    maps, picture = pictured(triangle[0])
    start = picture.judge(off(maps, 0.02))
    assert torch.equal(rounded(begun(picture, start), Deadline(1e-9)).shown.maps, start.maps)


def test_offsets_become_symmetric_only_where_all_nearly_are():
    near, far = torch.zeros(4, 6), torch.zeros(4, 6)
    near[:, 4], near[:, 5] = torch.tensor([0.3, -0.3004, 1e-4, -2e-5]), torch.tensor([0.2, 0.2001, -0.5, 0.1])
    far[:, 4] = torch.tensor([0.3, -0.3004, 0.2, -2e-5])
    found = mirrored_offsets(near, 0.1 * 2 / 128)
    assert torch.allclose(found[:, 4], torch.tensor([0.3002, -0.3002, OFF_MIDDLE, -OFF_MIDDLE]), atol=1e-7)
    assert torch.equal(found[:, 5], near[:, 5])
    assert torch.equal(mirrored_offsets(far, 0.1 * 2 / 128), far)
