"""Pictures that others drew: the pen, the tiles and the dots of their camera, and the code behind them."""

import math

import numpy as np
import pytest
import torch
from collage_helpers import CAMERA, PARAMS, dot_camera, pen_camera
from drawn_helpers import PIXEL, SIDE, at, triangles
from scipy.ndimage import gaussian_filter

from fractal_exp import IFS, codes, invert, suite
from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.estimate import TILED, estimated, nearest
from fractal_exp.cameras.kinds import levels_of, with_camera
from fractal_exp.cameras.levels import REUSE
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cameras.pens import DOT_SUPERSAMPLE, GAMMAS, Dots, Inked, ToneMapped
from fractal_exp.cameras.tile_kernels import collect, mark
from fractal_exp.cameras.tiles import tiled, words
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import DRAWN, meaning_of
from fractal_exp.likeness import ALIKE, Likeness, likeness_of_attractor
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.moves.drawn import LEAST_MOVES, DrawnSearch
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.drawn import DrawnMoves
from fractal_exp.methods.collage.stages.growth import UNLIKE, Growth
from fractal_exp.methods.collage.state import Candidate, State
from fractal_exp.rendering.still import render_with_info

SEGMENT = IFS(torch.tensor([[[.5, 0], [0, .5]], [[.5, 0], [0, .5]]]), torch.tensor([[-.25, 0.], [.25, 0]]))
GASKET = attractor.normalize(codes.known("sierpinski_triangle"))


@pytest.mark.parametrize("radius", [0.5, 1.0, 2.5])
def test_a_pen_covers_the_area_of_a_stroke(radius):
    drawn = Inked(CAMERA, torch.zeros(SIDE, SIDE), pen_camera(0.0, radius * PIXEL, 0.0)).render(SEGMENT, SIDE, 0)
    length = 1.0 / PIXEL
    assert float(drawn.sum()) == pytest.approx(2 * radius * length + math.pi * radius**2, rel=0.08)


def test_dots_follow_the_density_of_points():
    gain, sigma = 0.2, 1.5
    drawn = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(gain, sigma * PIXEL)).render(GASKET, SIDE, 3)
    fine = DOT_SUPERSAMPLE
    density, _ = render_with_info(GASKET, resolution=SIDE * fine, supersample=1, mode="density", seed=3,
                                  points_in_view=round(CAMERA.points_per_pixel * SIDE**2), reuse=REUSE)
    inked = 1 - np.exp(-gain * gaussian_filter(density.numpy(), sigma * fine, mode="constant"))
    expected = inked.reshape(SIDE, fine, SIDE, fine).mean((1, 3))
    assert np.abs(drawn.numpy() - expected).max() < 1e-4


def test_words_are_as_small_as_asked_for_and_their_first_letters_are_not():
    found = words(affine.from_code(GASKET), 1.5 / 8, 6000)
    assert len(found) == 27
    assert bool((1.5 * affine.largest_singular(found) <= 1.5 / 8 + 1e-6).all())


def test_maps_that_hardly_contract_do_not_give_endless_words():
    turn = torch.tensor([[0.0, -0.999, 0.999, 0, 0, 0], [0.5, 0, 0, 0.5, 0.3, 0]])
    assert len(words(turn, 0.05, 6000)) <= 6000


def test_the_kernels_of_tiles_see_and_mark_what_torch_does():
    random = np.random.default_rng(0)
    found = torch.from_numpy(random.uniform(-0.9, 0.9, (20, 6))).float()
    places, image = torch.from_numpy(random.uniform(-0.9, 0.9, (50, 2))).float(), torch.rand(9, 9)
    at = places @ found[:, :4].unflatten(1, (2, 2)).transpose(1, 2) + found[:, None, 4:]
    at = at * at.new_tensor([1, -1])
    assert (at.flatten(0, 1) > 1).any(0).all() and (at.flatten(0, 1) < -1).any(0).all(), "some lie off every edge"
    shares, levels, occupied = np.linspace(1, 2, 20), np.zeros(50), np.zeros((64, 64))
    collect(image.numpy(), found.numpy(), shares, places.numpy(), levels)
    seen = torch.nn.functional.grid_sample(image[None, None], at[None], align_corners=False)[0, 0]
    assert levels == pytest.approx((torch.from_numpy(shares).float() @ seen).numpy(), abs=1e-4)
    mark(found.numpy(), places.numpy(), occupied)
    column, row = ((at + 1) * 32).long().clamp(0, 63).flatten(0, 1).T
    assert {*zip(*occupied.nonzero(), strict=True)} == {*zip(row.tolist(), column.tolist(), strict=True)}


@pytest.mark.parametrize("depth", [3, 4])
def test_a_construction_is_explained_by_tiles_of_its_depth_under_the_true_code_alone(depth):
    image = at(triangles(depth))
    judge = ImageObjective(image, levels_of(image, DRAWN, CAMERA), PARAMS)
    size = 1.5 / 2**depth
    true = judge.error(tiled(image, GASKET, size, SIDE, 3))
    other = judge.error(tiled(image, GASKET.similar(0.97, (0.0, 0.0)), size, SIDE, 3))
    pen = judge.error(Inked(CAMERA, image, pen_camera(0.0, 0.5 * PIXEL, 0.0)).render(GASKET, SIDE, 0))
    assert true < 0.5 * other and true < 0.5 * pen


def test_tiles_are_taken_only_if_they_suit_the_code_much_better_than_a_pen():
    image = at(triangles(4))
    levels = levels_of(image, DRAWN, CAMERA)
    tried = nearest(image, levels, GASKET, 0)
    pen, tile = (next(each for each in tried if with_camera(levels, each[1]).shows_attractor is kind)
                 for kind in (True, False))
    assert tile[0] < TILED * pen[0], "this is a construction of few steps"
    assert estimated(image, levels, GASKET, 0) == tile[1]
    shown = levels_of(drawn := with_camera(levels, pen[1]).render(GASKET, SIDE, 1), DRAWN, CAMERA)
    assert estimated(drawn, shown, GASKET, 0).tile == 0, "a pen drew this"


def test_the_pen_of_a_line_drawing_is_found():
    camera = pen_camera(0.0, 1.5 * PIXEL, 0.5 * PIXEL)
    image = Inked(CAMERA, torch.zeros(SIDE, SIDE), camera).render(GASKET, SIDE, 1)
    found = estimated(image, levels_of(image, meaning_of(image), CAMERA), GASKET, 0)
    assert (found.kind, found.tile) == ("coverage", 0)
    assert (found.pen, found.blur) == pytest.approx((camera.pen, camera.blur), abs=0.3 * PIXEL)


def test_the_dots_of_a_scatter_plot_are_found():
    code = attractor.normalize(codes.known("fern"))
    image = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(0.16, 0.5 * PIXEL)).render(code, SIDE, 1)
    found = estimated(image, levels_of(image, meaning_of(image), CAMERA), code, 0)
    assert found.kind == "dots"
    assert found.gain == pytest.approx(0.16, rel=0.5) and found.blur == pytest.approx(0.5 * PIXEL, abs=0.3 * PIXEL)


def histogram(code, points=400_000):
    """Counts (side, side) of a chaos game, by NumPy alone."""
    generator, thrown = np.random.default_rng(5), np.zeros((2000, 2))
    linear, offset, shares = (part.double().numpy() for part in (code.linear, code.offset, code.probabilities))
    counts = np.zeros((SIDE, SIDE))
    for step in range(30 + points // len(thrown)):
        chosen = generator.choice(len(code), len(thrown), p=shares / shares.sum())
        thrown = np.einsum("pij,pj->pi", linear[chosen], thrown) + offset[chosen]
        if step >= 30:
            column, row = ((thrown * [1, -1] + 1) * SIDE / 2).astype(int).T
            np.add.at(counts, (row, column), 1)
    return counts


TONES = {"gamma 2.2": (lambda counts: counts ** (1 / 2.2), (1.5, 3)), "logarithm": (np.log1p, (1.5, 6))}


@pytest.mark.parametrize("name", TONES)
def test_a_density_behind_a_tone_curve_is_told_from_dots_and_lines(name):
    code, (curve, gammas) = attractor.normalize(codes.known("fern")), TONES[name]
    counts = curve(histogram(code))
    image = torch.from_numpy(np.rint(255 * counts / np.quantile(counts[counts > 0], 0.999)).clip(0, 255) / 255).float()
    found = estimated(image, levels_of(image, meaning_of(image), CAMERA), code, 0)
    assert found.kind == "tonemapped" and gammas[0] <= found.gamma <= gammas[1]


@pytest.mark.parametrize("contrast", [10, 100, 1000, 10_000])
def test_gain_and_gamma_together_are_close_to_a_logarithm(contrast):
    """In the units in which images are compared, where chance alone makes some hundredths of a radian."""
    density = np.linspace(0, 1, 1001)[1:]
    wanted = np.log1p(contrast * density) / np.log1p(contrast)
    tried = [(1 - np.exp(-gain * density)) ** (1 / gamma)
             for gain in np.geomspace(0.5, 300, 40) for gamma in (1, *GAMMAS)]
    off = min(np.sqrt(np.mean((np.arcsin(np.sqrt(each)) - np.arcsin(np.sqrt(wanted))) ** 2)) for each in tried)
    assert off < 0.05


@pytest.mark.parametrize("camera", [Camera("tonemapped", gain=0.1, gamma=2.2, blur=0.0), dot_camera(0.1, 0.0),
                                    pen_camera(0.0, PIXEL, 0.0)])
def test_the_search_by_renderings_has_the_masses_of_the_camera_that_was_found(camera):
    image = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(0.1, 0.0)).render(GASKET, SIDE, 1)
    problem = SearchProblem(image, levels_of(image, DRAWN, CAMERA), PARAMS)
    search = problem.image_search(GASKET, problem.deadline, "test", camera=camera)
    assert torch.equal(search.masses, with_camera(problem.levels, camera).measure(image))
    assert torch.equal(search.masses, problem.masses) == (camera.kind == "coverage")


def test_a_code_beside_the_canvas_has_a_tone_curve_too():
    """No point of this code lies on the canvas."""
    code = GASKET.similar(1.0, (9.0, 9.0))
    image = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(0.1, 0.0)).render(GASKET, SIDE, 1)
    (camera, rendering), = ToneMapped(CAMERA, image).candidates(code, SIDE, 0)
    assert camera.gamma and not bool(rendering.any())


def test_a_tone_curve_is_undone_by_the_measure_that_is_searched():
    """Which is that of a density, up to a factor."""
    image = Dots(CAMERA, torch.zeros(SIDE, SIDE), dot_camera(0.1, 0.5 * PIXEL)).render(GASKET, SIDE, 1)
    curved = image ** (1 / 3)
    levels = ToneMapped(CAMERA, curved, Camera("tonemapped", gain=0.1, gamma=3.0, blur=0.5 * PIXEL))
    torch.testing.assert_close(levels.measure(curved), Dots(CAMERA, image).hits(image), rtol=1e-3, atol=1e-5)
    torch.testing.assert_close(levels.render(GASKET, SIDE, 1), curved, rtol=1e-3, atol=1e-4)
    small = Dots(CAMERA, image).shrunk(image.double(), 32) ** (1 / 3)
    torch.testing.assert_close(levels.shrunk(curved.double(), 32), small, rtol=1e-3, atol=1e-4)


def test_a_camera_that_is_given_is_not_estimated():
    camera = CAMERA.updated(pen_px=2.0, blur_px=1.0)
    image = at(triangles(4))
    tried = Inked(camera, image).candidates(GASKET, SIDE, 0)
    assert {each for each, _ in tried} == {pen_camera(0.0, 2.0 * PIXEL, 1.0 * PIXEL)}


def test_our_own_grey_levels_are_known_and_others_are_not():
    own = suite.target(GASKET, SIDE, "grey")
    assert meaning_of(own) == "density"
    assert meaning_of((own * 65535).round() / 65535) == "density"
    assert meaning_of((own * 255).round() / 255) == "drawn"
    assert meaning_of((own > 0.25).float()) == "binary"
    assert meaning_of(at(np.float32(own > 0.25), SIDE // 2)) == "drawn"  # shrunk: quarters


def test_rounds_with_different_cameras_are_compared_by_angles():
    """Dots count 256 subpixels a pixel and a pen 16, so a dots code may have the larger error and the smaller angle."""
    moves = DrawnMoves(SearchProblem(torch.rand(SIDE, SIDE), levels_of(torch.rand(SIDE, SIDE), DRAWN, CAMERA),
                                     PARAMS))
    maps = affine.from_code(GASKET)
    pen = Candidate(maps, None, 2.0, 2.0, pen_camera(0.0, 0.01, 0.01))
    dots = [Candidate(maps, None, error, error, dot_camera(0.25, 0.01)) for error in (31.0, 33.0)]
    assert [moves.is_better(each, pen) for each in dots] == [True, False]
    assert [moves.is_better(pen, each) for each in dots] == [False, True]


def test_a_picture_of_polygons_gives_the_textbook_code():
    found = invert(triangles(4), resolution=SIDE, moves={"drawn_count": 8},
                   search={"restarts": 1, "moves": 10, "detail_moves": 5, "proposals": 1})
    assert len(found.code) == 3
    assert found.code.linear.flatten().tolist() == pytest.approx([.5, 0, 0, .5] * 3, abs=0.01)
    assert found.camera.kind == "coverage"
    assert found.verdict.kind == "recovered"
    assert Likeness.of(found.code, found.target, found.camera).f1_1px > 0.98
    redrawn = found.redrawn()
    assert float((redrawn - found.target.image).abs().mean()) < 0.02


def test_a_code_that_explains_thick_lines_is_not_replaced_by_grown_maps():
    """Its attractor is thinner than the drawing; its drawing is not."""
    first, second = torch.tensor([[1 / 3, 0, 0, 1 / 3, -0.5, 0], [1 / 3, 0, 0, 1 / 3, 0.5, 0]])
    cantor, pen = affine.to_code(torch.stack([first, second])), pen_camera(0.0, 2.5 * PIXEL, 0.0)
    image = Inked(CAMERA, torch.zeros(SIDE, SIDE), pen).render(cantor, SIDE, 0)
    levels = Inked(CAMERA, image)
    found = Candidate(torch.stack([first, second]), None, 0.0, 0.0, pen)
    growth = Growth(SearchProblem(image, levels, PARAMS))
    assert growth.grower.likeness(found, pen_camera(0.0, 0.1 * PIXEL, 0.0)) < UNLIKE
    assert not growth.is_wanted(State(best=found))


@pytest.mark.parametrize(("tile", "apart", "on_the_shape"), [
    (8.0, 5, True), (0.0, 5, False), (28.0, 14, False), (28.0, 5, True)])
def test_an_attractor_may_be_off_a_lattice_by_half_a_small_tile(tile, apart, on_the_shape):
    lattice = Inked(CAMERA, torch.zeros(SIDE, SIDE), pen_camera(0.0, 0.1 * PIXEL, 0.0)).render(SEGMENT, SIDE, 0)
    lattice = sum(torch.roll(lattice, apart * k, 0) for k in range(-4, 5)).clamp(max=1)
    half = torch.tensor([[0, -2 * apart * PIXEL], [0, 2 * apart * PIXEL]]).repeat(2, 1)
    filled = IFS(SEGMENT.linear[[0, 0, 1, 1]], SEGMENT.offset[[0, 0, 1, 1]] + half)  # the rectangle of the lines
    levels = Inked(CAMERA, lattice, pen_camera(tile * PIXEL, 0.0, 0.0))
    assert (likeness_of_attractor(filled, lattice, levels) > 0.95) == on_the_shape


@pytest.mark.parametrize("crosses, settled", [(0, True), (5, False)])
def test_a_search_does_not_end_with_a_filled_square_in_the_place_of_one_with_thin_crosses(crosses, settled):
    image = torch.zeros(128, 128)
    image[16:112, 16:112] = 1
    for line in (32, 48, 64, 80, 96)[:crosses]:
        image[line, 20:108] = image[20:108, line] = 0.2
    levels = with_camera(levels_of(image, DRAWN, CameraParams()), Camera("coverage", tile=0.0, pen=0.01, blur=0.005))
    search = DrawnSearch(ImageObjective(image, levels, PARAMS, 0), image, noise=0.1)
    corner = torch.tensor([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]) * 0.375
    square = Candidate(torch.cat([torch.tensor([[0.5, 0, 0, 0.5]]).repeat(4, 1), corner], 1), None, 0.0, 0.0)
    assert search.objective.likeness(search.shown(square).image) > ALIKE
    assert search.is_settled(square, LEAST_MOVES) is settled and not search.is_settled(square, LEAST_MOVES - 1)
