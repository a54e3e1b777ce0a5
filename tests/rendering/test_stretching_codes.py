"""Pictures, zooms and morphs of codes whose maps stretch in some direction."""

import logging

import numpy as np
import pytest
import torch

from fractal_exp import IFS, InputError, View, codes, render
from fractal_exp.ifs.attractor import normalize, random_point, visible_box
from fractal_exp.rendering import film, zoom
from fractal_exp.rendering.morph import morph, morph_path
from fractal_exp.rendering.still import render_with_info

TAKAGI = IFS.from_json([[0.5, 0, 1, 0.5, 0, 0], [0.5, 0, -1, 0.5, 0.5, 0.5]])  # the graph of 2 T(x) - x over [0,1]
HALF_TURN = IFS.from_json([[0.5, -0.3, 0.3, 0.5, 1, 1, 0.5], [-1, 0, 0, -1, 0, 10, 0.5]])
TAILS = IFS([[[3, 0], [0, 3]], [[0, 0], [0, 0]]], [[0, 0], [1, -1]], [0.3, 0.7])  # 3^k (1, -1), chance 0.7 · 0.3^k
HEAVY = IFS([[[1.5, 0.3], [0, 0.9]], [[0.3, -0.2], [0.2, 0.3]]], [[0, 0], [1, 1]], [0.3, 0.7])


def takagi(x: np.ndarray) -> np.ndarray:
    """2 T(x) - x by the definition of T, the sum of the distances of 2^n x from whole numbers, over 2^n."""
    total = -x
    for n in range(60):
        total = total + 2 * np.abs(2.0**n * x - np.rint(2.0**n * x)) / 2.0**n
    return total


@pytest.mark.parametrize("at", [1 / 3, 0.3, 0.71828182])
@pytest.mark.parametrize("closeness", [1, 1e3, 1e6])
def test_takagis_curve_has_its_exact_values_at_any_zoom(at, closeness):
    size, view = 64, View((at, float(takagi(np.array(at)))), float(closeness))
    lit = render(TAKAGI, view, resolution=size, points_in_view=200_000, supersample=1).numpy() > 0
    left, _, _, top = view.box
    pixel = 2 / closeness / size
    within = left + (np.arange(size)[:, None] + np.linspace(0, 1, 257)) * pixel
    rows = (top - takagi(within)) / pixel
    seen = 0
    for column in np.flatnonzero((within >= 0).all(1) & (within <= 1).all(1)):
        low, high = rows[column].min(), rows[column].max()
        drawn = np.flatnonzero(lit[:, column])
        assert not len(drawn) or (low - 1.5 <= drawn.min() and drawn.max() <= high + 0.5), "a point off the curve"
        if 1 < low and high < size - 1:
            assert len(drawn) and drawn.min() <= low + 1 and drawn.max() >= high - 2, "a gap in the curve"
            seen += 1
    assert seen > (2 if at > 0.5 else 10)  # the curve is steep there


@pytest.mark.parametrize("code", [TAKAGI, HALF_TURN, HEAVY], ids=["takagi", "turn", "heavy"])
def test_a_view_has_the_mass_that_a_chaos_game_finds_in_it(code):
    random = np.random.default_rng(5)
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    chance = code.sampling_probabilities().double().numpy()
    x, inside = np.zeros((100_000, 2)), 0
    x0, y0, x1, y1 = visible_box(code)
    view = View((x0 + 0.4 * (x1 - x0), y0 + 0.6 * (y1 - y0)), 5 / max(x1 - x0, y1 - y0))
    for step in range(120):
        i = random.choice(len(code), len(x), p=chance / chance.sum())
        x = np.einsum("kij,kj->ki", linear[i], x) + offset[i]
        inside += (np.abs(x - view.center).max(1) < 1 / view.zoom).sum() * (step >= 100)
    info = render_with_info(code, view, resolution=64, points_in_view=100_000)[1]
    assert info.reason is None and info.mass == pytest.approx(inside / 20 / len(x), rel=0.05)


@pytest.mark.parametrize("power", [0, 4, 8])
def test_tails_are_drawn_close_up_as_far_as_the_likely_box_reaches(power):
    info = render_with_info(TAILS, View((3**power, -(3**power)), 1e6), resolution=8, points_in_view=1000)[1]
    assert info.reason is None and info.mass == pytest.approx(0.7 * 0.3**power, rel=0.03)


def test_beyond_it_points_are_thrown_at_the_whole_and_their_number_is_told(caplog):
    with caplog.at_level(logging.WARNING):
        info = render_with_info(TAILS, View((3**13, -(3**13)), 1e3), resolution=8, points_in_view=10)[1]
    assert info.mass == pytest.approx(0.7 * 0.3**13, rel=0.5) and info.drawn > 0
    assert "nothing but tails" in caplog.text and "e+07 points are thrown for its 10" in caplog.text
    empty = render_with_info(TAILS, View((3**13, 0), 1e3), resolution=8, points_in_view=10)[1]
    assert empty.empty and "empty" in empty.reason


@pytest.mark.parametrize("code", [TAKAGI, HALF_TURN, HEAVY], ids=["takagi", "turn", "heavy"])
def test_every_code_is_framed_zoomed_into_and_filmed(code):
    framed = normalize(code)
    x0, y0, x1, y1 = visible_box(framed)
    assert max(x1 - x0, y1 - y0) == pytest.approx(1.5, abs=0.02) and abs(x0 + x1) + abs(y0 + y1) < 0.05
    path = zoom.zoom_path(random_point(framed, 3), 3, end_zoom=50)
    assert all(float(picture.max()) > 0 for picture in film.frames(framed, path, resolution=32, supersample=1))


def test_the_point_of_takagis_curve_nearest_to_another_is_on_it():
    x, y = zoom.nearest_point(TAKAGI, (0.3, 1.5))
    assert y == pytest.approx(float(takagi(np.array(x))), abs=1e-9) and y > 0.9


def test_a_morph_between_stretching_codes_is_drawn_or_refused():
    between, views = morph_path([TAKAGI, codes.known("fern")], 8)
    assert all(code.contraction.kind != "neither" for code in between) and len(views) == 8
    one, other = IFS([[[0.5, 8], [0, 0.5]]], [[0, 0]]), IFS([[[0.5, 0], [8, -0.5]]], [[0, 0]])
    assert one.contraction.kind == other.contraction.kind == "norm"
    with pytest.raises(InputError, match="must be contractive"):
        morph(one, other, 0.5)
    plain = [IFS(torch.diag_embed(torch.rand(3, 2) * 0.9), torch.rand(3, 2)) for _ in range(2)]
    assert float(morph(*plain, 0.5).singular_values().max()) < 1
