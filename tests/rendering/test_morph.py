"""Codes between codes: the ends, pairs, turns, contraction, births, and the camera."""

import math

import numpy as np
import pytest
import torch

from fractal_exp import IFS, InputError, codes
from fractal_exp.ifs import attractor
from fractal_exp.ifs.colours import Colours
from fractal_exp.rendering.morph import morph, morph_path
from fractal_exp.suite import random_suite

TIMES = np.linspace(0, 1, 21)
NEARLY = 1e-6


def turned(angle: float, large: float, small: float | None = None) -> list[list[float]]:
    c, s, small = math.cos(angle), math.sin(angle), large if small is None else small
    return [[large * c, -small * s], [large * s, small * c]]


def one(matrix, offset=(0.0, 0.0)) -> IFS:
    return IFS(torch.as_tensor(matrix)[None], [offset])


def angle(code: IFS) -> float:
    (a, b), (c, d) = code.linear[0].tolist()
    return math.atan2(c - b, a + d)


def known(name: str) -> IFS:
    return attractor.normalize(codes.known(name))


def test_the_ends_are_the_codes():
    a, b = known("fern"), known("koch_snowflake")
    assert morph(a, b, 0) is a and morph(a, b, 1) is b


def test_the_order_of_maps_does_not_matter():
    a, b = known("fern"), known("maple_leaf")
    order = torch.tensor([2, 0, 3, 1])
    p = b.sampling_probabilities()
    shuffled = IFS(b.linear[order], b.offset[order], p[order])
    assert torch.equal(morph(a, IFS(b.linear, b.offset, p), 0.3).linear, morph(a, shuffled, 0.3).linear)


@pytest.mark.parametrize(("start", "end", "middle"), [(0.2, 1.4, 0.8), (3.0, -3.0, math.pi), (-2.9, 2.5, -3.34159)])
def test_a_map_turns_by_the_shorter_way_and_scales_in_proportion(start, end, middle):
    half = morph(one(turned(start, 0.8)), one(turned(end, 0.2)), 0.5)
    assert math.cos(angle(half) - middle) == pytest.approx(1, abs=1e-6)
    torch.testing.assert_close(half.singular_values(), torch.full((1, 2), 0.4))
    quarter = morph(one(turned(start, 0.8)), one(turned(end, 0.05)), 0.25)
    torch.testing.assert_close(quarter.singular_values(), torch.full((1, 2), 0.4))
    turn = math.remainder(end - start, 2 * math.pi)
    assert math.remainder(angle(quarter) - start, 2 * math.pi) == pytest.approx(turn / 4, abs=1e-6)


def test_a_reflection_is_reached_through_a_flat_map_and_never_a_point():
    a, b = one(turned(0.4, 0.6)), one(np.array(turned(1.0, 0.6)) @ np.diag([1.0, -1.0]))
    dets = [float(torch.linalg.det(morph(a, b, t).linear)) for t in TIMES]
    assert (np.diff(dets) < 0).all() and dets[0] > 0 > dets[-1]
    assert min(float(morph(a, b, t).singular_values()[0, 0]) for t in TIMES) > 0.59


@pytest.mark.parametrize("seed", range(3))
def test_all_maps_stay_below_the_singular_values_of_the_ends(seed):
    """Of a pair, the norm is at most the geometric mean, or for reflections and flat maps the arithmetic one."""
    rng = np.random.default_rng(seed)
    for _ in range(40):
        linear = rng.normal(size=(2, 1, 2, 2))
        linear *= (rng.uniform(0.01, 0.999, 2) / np.linalg.norm(linear, 2, (-2, -1))[:, 0])[:, None, None, None]
        if seed == 2:
            linear[0] = np.outer(linear[0, 0, 0], rng.normal(size=2)) * 0.3
        a, b = (IFS(each, rng.normal(size=(1, 2))) for each in linear)
        if float(a.singular_values().max()) >= 1:
            continue
        ends = [float(each.singular_values().max()) for each in (a, b)]
        full = float(torch.linalg.det(a.linear)) * float(torch.linalg.det(b.linear)) > 0 and seed < 2
        for t in TIMES:
            largest = float(morph(a, b, t).check_contractive().singular_values().max())
            bound = ends[0]**(1 - t) * ends[1]**t if full else (1 - t) * ends[0] + t * ends[1]
            assert largest <= bound + NEARLY


@pytest.mark.parametrize(("small", "large"), [("sierpinski_triangle", "koch_snowflake"), ("heighway_dragon", "fern")])
def test_surplus_maps_grow_from_points_of_the_attractor(small, large):
    a, b = known(small), known(large)
    early = morph(a, b, 1e-4)
    assert len(early) == len(b)
    born = early.sampling_probabilities() < 1e-3
    assert int(born.sum()) == len(b) - len(a) and float(early.sampling_probabilities()[born].sum()) < 1e-3
    assert float(early.singular_values()[born].max()) < 1e-3
    points = attractor.random_points(a, 20_000)[0]
    for place in early.offset[born].double().numpy():
        assert np.hypot(*(points - place).T).min() < 0.02
    # The other way round is the same film backwards.
    there, back = (morph(*ends, t) for ends, t in (((a, b), 0.3), ((b, a), 0.7)))
    order, backwards = (code.offset[:, 0].argsort() for code in (there, back))
    torch.testing.assert_close(there.linear[order], back.linear[backwards], atol=1e-5, rtol=0)
    torch.testing.assert_close(there.sampling_probabilities()[order], back.sampling_probabilities()[backwards])


@pytest.mark.parametrize("loop", [False, True])
def test_every_frame_holds_its_attractor_and_the_camera_moves_smoothly(loop):
    stops = [codes.known("sierpinski_triangle"), codes.known("fern"), random_suite(4)[3]]
    path, views = morph_path(stops, 120, loop=loop)
    assert len(path) == len(views) == 120
    for code, view in zip(path, views, strict=True):
        box, seen = attractor.visible_box(code), view.box
        padding = 0.2 / view.zoom  # of 0.25, as rounding of the box may take a little
        assert (box[:2] > np.array(seen[:2]) + padding).all() and (box[2:] < np.array(seen[2:]) - padding).all()
        assert max(box[2:] - box[:2]) * view.zoom > 0.75, "no more than half the frame is empty"
    zooms = np.log([view.zoom for view in views])
    centers = np.array([view.center for view in views]) * np.exp(zooms)[:, None]
    around = [*range(120), 0] if loop else range(120)
    assert np.abs(np.diff(zooms[around])).max() < 0.06 and np.abs(np.diff(zooms[around], 2)).max() < 0.02
    assert np.abs(np.diff(centers[around], axis=0)).max() < 0.06


@pytest.mark.parametrize(("work", "message"), [
    (lambda: morph(known("fern"), known("tree"), 1.5), "t must be a number from 0 to 1, got 1.5"),
    (lambda: morph(known("fern"), "tree", 0.5), "made of codes .IFS., got 'tree'"),
    (lambda: morph(known("fern"), one([[1.0, 0], [0, 0.5]]), 0.5), "must be contractive"),
    (lambda: morph(*(IFS(torch.zeros(maps, 2, 2), torch.zeros(maps, 2)) for maps in (200, 51)), 0.5),
     "at most 10000 pairs of maps, got 200 and 51"),
    (lambda: morph_path([known("fern")], 20), "at least 2 codes, got 1"),
    (lambda: morph_path([known("fern"), known("tree")], 3, loop=True), "at least 4 frames, got 3"),
    (lambda: morph_path([known("fern"), known("tree")], 2.5), "frames must be an integer"),
    (lambda: morph_path([known("fern"), 3], 9), "got 3"),
])
def test_what_cannot_be_morphed(work, message):
    with pytest.raises(InputError, match=message):
        work()


def test_colours_move_with_their_maps_if_both_codes_have_them():
    red, blue = (IFS(code.linear, code.offset, colours=Colours(torch.tensor([rgb] * len(code)), torch.full((len(code),),
                                                                                                       blend)))
                 for code, rgb, blend in ((codes.known("fern"), (1.0, 0.0, 0.0), 0.5),
                                          (codes.known("heighway_dragon"), (0.0, 0.0, 1.0), 0.7)))
    between = morph(red, blue, 0.25)
    own = between.colours.rgb.round(decimals=5).unique(dim=0).tolist()
    assert own == [pytest.approx([0.75, 0, 0.25]), [1, 0, 0]], "of the pairs, and of the maps that shrink"
    assert between.colours.blends.min() == 0.5 and between.colours.blends.max() == pytest.approx(0.55)
    assert morph(red, codes.known("heighway_dragon"), 0.25).colours is None
