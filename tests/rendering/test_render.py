"""Renderings against known answers: whole views, deep zooms, modes, tiles, and everything a user can get wrong."""

import logging
import math
import time
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import torch

from fractal_exp import IFS, InputError, View, codes
from fractal_exp.ifs import attractor
from fractal_exp.ifs.colours import Colours
from fractal_exp.rendering.still import points_per_view, render, render_tiles, render_with_info
from fractal_exp.rendering.tone import tone_map
from fractal_exp.runtime import threads
from fractal_exp.suite import random_suite

HALF = torch.eye(2).expand(4, 2, 2) / 2


def square() -> IFS:
    """The invariant measure is uniform on [-0.5,0.5]²."""
    return IFS(HALF, torch.tensor([[-1.0, -1], [-1, 1], [1, -1], [1, 1]]) / 4)


def gasket() -> IFS:
    """Sierpinski's triangle with corners (0,0), (1,0) and (0,1)."""
    return IFS(HALF[:3], torch.tensor([[0.0, 0], [0.5, 0], [0, 0.5]]))


def f1(a, b) -> float:
    a, b = a > 0, b > 0
    return float(2 * (a & b).sum() / (a.sum() + b.sum()))


def test_occupancy_is_that_of_a_poisson_process():
    # 64² pixels of 4² parts over the square's quarter of the canvas: rho points a part.
    image, info = render_with_info(square(), resolution=64, points_in_view=100_000, supersample=4)
    rho = info.drawn / (64 * 64 * 16 / 4)
    assert float(image[16:48, 16:48].mean()) == pytest.approx(1 - math.exp(-rho), rel=5e-3)
    outside = image.clone()
    outside[15:49, 15:49] = 0
    assert float(outside.sum()) == 0
    assert info.drawn == pytest.approx(100_000, rel=0.02) and info.mass == 1 and info.reason is None


def test_orientation_x_right_y_up():
    image = render(IFS(torch.zeros(1, 2, 2), torch.tensor([[0.6, 0.3]])), resolution=10, points_in_view=5)
    assert (image > 0).nonzero().tolist() == [[3, 8]]


def test_density_is_relative_to_uniform():
    image = render(square(), View(zoom=2), resolution=16, points_in_view=2_000_000, mode="density")
    assert float(image.mean()) == pytest.approx(1, rel=5e-3)
    assert float((image - 1).abs().max()) < 0.06
    picture = tone_map(image)
    assert 0 <= float(picture.min()) and float(picture.max()) <= 1


@pytest.mark.parametrize("power", [4, 20, 33])
def test_a_corner_of_the_gasket_looks_the_same_at_every_power_of_two(power):
    whole = render(gasket(), View((0.5, 0.5), 2), resolution=64, points_in_view=400_000, seed=1)
    zoom = 2.0**power
    deep, info = render_with_info(gasket(), View((0.5 / zoom, 0.5 / zoom), 2 * zoom), resolution=64,
                                  points_in_view=400_000, seed=2)
    assert f1(whole, deep) > 0.98 and float((whole - deep).abs().mean()) < 0.01
    assert info.mass == pytest.approx(3.0**-power, rel=0.02)
    assert info.drawn == pytest.approx(400_000, rel=0.02)


def test_a_million_times_zoom_is_exact_to_a_pixel():
    """Points computed in rational arithmetic lie on lit pixels of the view."""
    code = attractor.normalize(codes.known("fern"))
    linear = [[[Fraction(float(v)) for v in row] for row in matrix] for matrix in code.linear]
    offset = [[Fraction(float(v)) for v in row] for row in code.offset]

    def point(word):
        x = y = Fraction(0)
        for i in reversed(word):
            (a, b), (c, d) = linear[i]
            x, y = a * x + b * y + offset[i][0], c * x + d * y + offset[i][1]
        return x, y

    rng = np.random.default_rng(4)
    p = code.sampling_probabilities().double().numpy()
    word = rng.choice(4, 160, p=p / p.sum()).tolist()
    center = point(word)
    view, resolution = View((float(center[0]), float(center[1])), 1e6), 512
    image = render(code, view, resolution=resolution, points_in_view=3_000_000, supersample=2)
    lit = torch.nn.functional.max_pool2d(image[None, None], 3, stride=1, padding=1)[0, 0] > 0
    checked = 0
    for tail in range(40):
        x, y = point(word[:110] + rng.choice(4, 60, p=p / p.sum()).tolist())
        column = int((x - Fraction(view.center[0])) * 1_000_000 * resolution / 2 + resolution // 2)
        row = int((Fraction(view.center[1]) - y) * 1_000_000 * resolution / 2 + resolution // 2)
        if 0 <= row < resolution and 0 <= column < resolution:
            checked += 1
            assert lit[row, column], f"point {tail} is not on the picture"
    assert checked >= 20


@pytest.mark.parametrize("reuse", [1, 8])
@pytest.mark.parametrize("mode", ["occupancy", "density"])
def test_the_same_seed_gives_the_same_image_on_any_number_of_threads(mode, reuse):
    code, view = attractor.normalize(random_suite(1)[0]), View((0.1, 0.2), 3)
    arguments = {"resolution": 64, "points_in_view": 50_000, "mode": mode, "reuse": reuse}
    try:
        threads.use(1)
        one, _ = render_with_info(code, view, seed=5, **arguments)
    finally:
        threads.use()
    assert torch.equal(one, render_with_info(code, view, seed=5, **arguments)[0])
    assert not torch.equal(one, render_with_info(code, view, seed=6, **arguments)[0])


@pytest.mark.parametrize(("size", "lit"), [
    ((32, 64), (slice(8, 24), slice(24, 40))), ((64, 32), (slice(24, 40), slice(8, 24))),
    ((32, 33), (slice(8, 24), slice(8, 25)))], ids=["wide", "tall", "nearly square"])
@pytest.mark.parametrize("mode", ["occupancy", "density", "tinted"])
def test_a_picture_that_is_not_square_shows_the_views_square_in_its_middle(size, lit, mode):
    code = replace(square(), colours=Colours(torch.eye(4, 3), torch.full((4,), 0.5)))
    image = render(code, resolution=size, points_in_view=400_000, mode=mode)
    assert image.shape[:2] == size
    levels = image[..., 3] if mode == "tinted" else image
    inside = levels[lit]
    if size == (32, 33):  # the shape's left and right edge halve a pixel each
        assert float(levels[:, 8].mean() / levels[:, 16].mean()) == pytest.approx(0.5, abs=0.1)
        inside = inside[:, 1:-1]
    wanted = 1.0 if mode == "occupancy" else size[0] * size[1] / 256  # pixels of the picture, of the shape
    assert float((inside / wanted - 1).abs().max()) < 0.15
    outside = levels.clone()
    outside[lit] = 0
    assert not outside.any()


@pytest.mark.parametrize(("size", "mass"), [((16, 32), 0.5), ((32, 16), 0.5), ((16, 64), 0.5), ((16, 24), 0.375)])
def test_the_mass_of_a_view_that_is_not_square(size, mass):
    """A zoom of 4 shows a quarter of the square's side, and so much more of it as the picture is longer."""
    image, info = render_with_info(square(), View(zoom=4), resolution=size, points_in_view=200_000, mode="density")
    assert info.mass == pytest.approx(mass, rel=0.02) and info.drawn == pytest.approx(200_000, rel=0.02)
    assert float(image.mean()) == pytest.approx(1, rel=0.02)
    assert points_per_view((512, 2048)) == points_per_view(1024) == 50_000_000


@pytest.mark.parametrize("size", [(64,), (64, 0), (64, 1.5), (64, 64, 4), [64, 64]])
def test_a_size_is_one_or_two_numbers_of_pixels(size):
    with pytest.raises(InputError, match="resolution must be"):
        render(square(), resolution=size)


@pytest.mark.parametrize(("mode", "size", "in_one", "count", "shape"), [
    ("occupancy", 130, 63, 4, (65, 65)), ("occupancy", (70, 130), 63, 2, (70, 65)),
    ("density", 260, 1, 9, (87, 87)), ("density", (140, 270), 1, 6, (70, 90))])
def test_tiles_are_equal_pieces_of_the_same_picture(mode, size, in_one, count, shape):
    """Of one that has fewer subpixels and so is drawn in one piece. Most subpixels hold one point, or none."""
    code, view = attractor.normalize(codes.known("fern")), View((0.1, 0.0), 1.5)
    arguments = {"resolution": size, "points_in_view": 400_000, "mode": mode}
    whole = render(code, view, **arguments, supersample=in_one, seed=1)
    tiles = list(render_tiles(code, view, **arguments, supersample=64))
    assert len(tiles) == count and all(tile.pixels.shape == shape for tile in tiles)
    assert sum(tile.drawn for tile in tiles) == pytest.approx(400_000, rel=0.02)
    tiled = render(code, view, **arguments, supersample=64, seed=2)
    assert f1(whole, tiled) > 0.97
    parts = (in_one / 64)**2 if mode == "occupancy" else 1
    assert float(tiled.mean()) == pytest.approx(parts * float(whole.mean()), rel=0.01)


def test_a_view_beside_the_attractor_is_black_at_once_and_says_so(caplog):
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    render(code, resolution=8, points_in_view=10)
    started = time.perf_counter()
    with caplog.at_level(logging.WARNING):
        image = render(code, View((5.0, 5.0), 3), resolution=64)
    assert float(image.sum()) == 0 and "no point of the attractor" in caplog.text
    hole, info = render_with_info(gasket(), View((1 / 3, 1 / 3), 1e5), resolution=64)  # a gap of the gasket
    assert info.empty and info.mass == 0 and "no point" in info.reason and float(hole.sum()) == 0
    assert time.perf_counter() - started < 2


def test_maps_that_overlap_heavily_end_with_fewer_points_and_say_so():
    turn = torch.tensor([[math.cos(1), -math.sin(1)], [math.sin(1), math.cos(1)]])
    linear = torch.stack([0.8 * turn, 0.8 * turn.T, 0.8 * torch.eye(2)])
    code = IFS(linear, torch.tensor([[0.2, 0], [-0.2, 0], [0, 0.1]]))
    image, info = render_with_info(code, View((0.05, 0.05), 5e3), resolution=32, points_in_view=2_000_000, effort=0.01)
    assert "overlap" in info.reason and 0 < info.drawn < 1_000_000 and float(image.sum()) > 0


def test_a_point_a_segment_and_a_collapsed_map_are_drawn():
    point, info = render_with_info(IFS(0.5 * torch.eye(2)[None], torch.tensor([[0.25, 0.25]])), View((0.5, 0.5), 1e6),
                                   resolution=9, points_in_view=1000)
    assert (point > 0).nonzero().tolist() == [[4, 4]] and info.mass == 1
    segment = IFS(HALF[:2], torch.tensor([[-0.25, 0.0], [0.25, 0.0]]))
    image = render(segment, View((0, 0.01), 1), resolution=16, points_in_view=10_000)
    assert (image > 0).any(1).sum() == 1 and (image > 0).any(0).sum() == 8
    collapsed = IFS(torch.stack([torch.zeros(2, 2), 0.5 * torch.eye(2)]), torch.tensor([[0.5, 0.0], [0.0, 0.0]]))
    assert 1 < int((render(collapsed, resolution=64, points_in_view=10_000) > 0).sum()) < 20


@pytest.mark.parametrize(("arguments", "message"), [
    ({"resolution": 0}, "resolution must be an integer of at least 1, got 0"),
    ({"resolution": 1_000_000}, "would take 7.45e.03 GiB of memory"),
    ({"points_in_view": 0}, "points_in_view"),
    ({"supersample": 0}, "supersample"),
    ({"supersample": 65}, "at most 64"),
    ({"seed": -1}, "seed"),
    ({"mode": "grey"}, "occupancy, density, colour"),
    ({"mode": "colour"}, "the code has no colours to draw; invert"),
    ({"mode": "colour", "device": "cuda"}, "colours are drawn on the CPU"),
    ({"view": View(zoom=1e13)}, "double precision"),
    ({"view": (0, 0)}, r"view must be a View, got \(0, 0\); View\(center, zoom\) makes one"),
    ({"supersample": True}, "supersample must be an integer of at least 1, got True"),
])
def test_what_cannot_be_drawn_is_said_before_any_work(arguments, message):
    with pytest.raises(InputError, match=message):
        render(gasket(), **({"resolution": 16} | arguments))
