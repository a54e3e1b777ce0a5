"""The sets of pictures from elsewhere: names, seeds, roles, and that every truth lies where its picture is."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

from benchmarks.pictures import binary, density_maps, judging, textbook, tone_curves
from benchmarks.pictures.figures import FIGURES, Truth, binary_tree, pentigree, tree_reach
from benchmarks.pictures.growth import GROWTH
from benchmarks.pictures.paving import paving
from benchmarks.pictures.report import MAIN_SCORES
from benchmarks.pictures.sets import SETS
from benchmarks.pictures.shapes import shapes
from benchmarks.pictures.terrain import drainage
from fractal_exp import IFS, InputError, codes
from fractal_exp.ifs import attractor
from fractal_exp.images.placement import Placement
from fractal_exp.images.reading import read_target

DEEPEST = {p.family: p for p in reversed(textbook.pictures().values()) if p.deepest and not p.jpeg}
HALVES = IFS(torch.eye(2).expand(2, 2, 2) / 2, torch.tensor([[-0.25, 0.0], [0.25, 0]]))


@pytest.mark.parametrize("kind", SETS)
def test_every_set_has_pictures_for_tuning_and_for_reporting(kind, monkeypatch):
    monkeypatch.delenv(density_maps.VARIABLE, raising=False)
    only = {"density": {"tuning"}, "random_trees": {"reporting"}}  # those of density need the published file
    assert set(SETS[kind].roles().values()) == only.get(kind, {"tuning", "reporting"})


def test_families_are_for_tuning_or_for_reporting():
    families = {picture.family for picture in textbook.pictures().values()}
    assert families == {*textbook.TUNING, *textbook.REPORTING} and not {*textbook.TUNING} & {*textbook.REPORTING}


def test_each_figure_is_drawn_in_every_colour_by_both_tools_and_as_jpeg():
    for family in FIGURES:
        own = [picture for picture in textbook.pictures().values() if picture.family == family]
        assert {picture.ink for picture in own} == {*textbook.COLOURS, "white"}
        assert {picture.tool for picture in own} == {"pillow", "matplotlib"}
        assert {picture.depth for picture in own} == {*FIGURES[family].depths} and 4 in FIGURES[family].depths
        assert any(picture.jpeg for picture in own)


@pytest.mark.parametrize("name", ["koch_curve-4-red", "fern_dots-green-jpeg", "carpet-3-green"])
def test_name_and_seed_make_the_picture(name):
    picture = textbook.pictures()[name]
    first, again, other = (picture.draw(seed).pixels for seed in (3, 3, 4))
    assert (first == again).all()
    assert other.shape != first.shape or (other != first).any()


def test_jpeg_is_its_twin_with_little_loss():
    plain, jpeg = (textbook.pictures()[name].source() for name in ("fern_dots-green", "fern_dots-green-jpeg"))
    with Image.open(jpeg) as picture:
        assert picture.format == "JPEG"
        assert 0 < np.abs(plain - np.asarray(picture, float)).mean() < 8


@pytest.mark.parametrize("family", sorted(DEEPEST))
def test_the_true_code_lies_on_its_picture(family):
    """Each lies within a pixel of the other; the thick trunk of a tree that thins out is one line of its truth."""
    drawn = DEEPEST[family].draw()
    target = read_target(drawn.pixels, 256)
    image = target.image.numpy()
    seen, true = image > 0.25 * image.max(), judging.true_drawing(drawn.truth_on(target.placement))
    assert (true & judging.thickened(seen)).sum() >= 0.95 * true.sum()
    assert (seen & judging.thickened(true)).sum() >= 0.97 * seen.sum()


def test_only_outline_and_pythagoras_tree_have_no_code():
    assert {name for name, figure in FIGURES.items() if figure.truth().code is None} == {"koch_outline", "pythagoras"}


def test_known_places_of_constructions():
    end = pentigree().linear[-1] @ torch.tensor([1.0, 0]) + pentigree().offset[-1]
    assert torch.allclose(end, torch.tensor([1.0, 0]), atol=1e-6), "its last segment ends where the first one ended"
    x0, y0, x1, y1 = attractor.visible_box(binary_tree())
    assert x0 == pytest.approx(-x1, abs=0.01) and y0 == pytest.approx(0, abs=0.02)
    assert x1 == pytest.approx(tree_reach(), abs=0.02)
    assert y1 == pytest.approx((1 + 0.66 * math.cos(math.pi / 6)) / (1 - 0.66**2), abs=0.02), "up, and again up"


def test_a_truth_is_placed_by_the_picture_s_own_similarity():
    drawn = textbook.pictures()["carpet-3-green"].draw()
    corners = drawn.similarity(np.array([[0, 0], [1, 1.0]]))
    placement = Placement((drawn.pixels.shape[1], drawn.pixels.shape[0]), (0.0, 0.0, 500.0, 500.0))
    (x0, y0), (x1, y1) = placement.to_canvas(corners)
    box = attractor.visible_box(drawn.truth_on(placement).codes[0])
    assert box == pytest.approx([x0, y0, x1, y1], abs=5e-3)


@pytest.mark.parametrize("name", ["koch_filled-5-blue", "koch_filled-5-green", "carpet-5-red", "pentagon-6-orange"])
def test_both_tools_draw_where_the_truth_is(name):
    """To an eighth of a pixel: counting pixels from their corners or from their centres would make more."""
    drawn = textbook.pictures()[name].draw()
    x0, y0, x1, y1 = attractor.visible_box(drawn.truth_on(read_target(drawn.pixels, 256).placement).codes[0])
    assert max(abs(x0 + x1), abs(y0 + y1)) / 2 * 128 < 0.125


def test_masks_of_known_overlap():
    a, b = np.zeros((2, 8, 8), bool)
    a[2, 2:6], b[2, 4:8] = True, True
    assert judging.iou(a, b) == pytest.approx(2 / 6) and judging.iou(a & b, ~a & a) == 0
    # Of each, the two shared pixels and the one beside them lie within a pixel of the other.
    assert judging.f1_within_a_pixel(a, b) == pytest.approx(3 / 4)
    assert judging.f1_within_a_pixel(a, a & ~a) == 0 and judging.f1_within_a_pixel(a & ~a, a & ~a) == 1


def test_a_code_is_exact_equivalent_or_neither():
    truth = replace(codes.known("sierpinski_triangle"), probabilities=None)
    truth = attractor.normalize(truth)
    exact = judging.against_truth(truth, Truth((truth,)))
    assert exact["exact"] and exact["recovered"] and not exact["equivalent"] and exact["iou"] == 1
    mirrored = replace(truth, linear=truth.linear * torch.tensor([[-1.0], [1]]).T)  # each copy about its own axis
    same = judging.against_truth(mirrored, Truth((truth,)))
    assert same["missed"] > 0 and same["equivalent"] and same["recovered"] and not same["exact"]
    doubled = IFS(torch.cat([truth.linear, truth.linear[:1]]), torch.cat([truth.offset, truth.offset[:1]]))
    more = judging.against_truth(doubled, Truth((truth,)))
    assert more["missed"] == 0 and not more["recovered"] and more["iou"] > 0.98, "one map too many"
    moved = replace(truth, offset=truth.offset + torch.tensor([[4 / 256, 0], [0, 0], [0, 0]]))
    assert judging.against_truth(moved, Truth((truth,)))["missed"] == 1


@pytest.mark.parametrize(("shift_px", "equivalent"), [(0.4, True), (3.0, False)])
def test_another_code_of_a_thin_figure_is_equivalent_if_it_is_within_a_pixel(shift_px, equivalent):
    third = torch.eye(2).expand(2, 2, 2) / 3
    truth = IFS(third, torch.tensor([[-0.5, 0.0], [0.5, 0]]))            # Cantor's set, on a line
    turned = IFS(third * torch.tensor([-1.0, 1]), truth.offset + torch.tensor([0.0, shift_px / 128]))
    found = judging.against_truth(turned, Truth((truth,)))
    assert found["missed"] == 2 and found["equivalent"] == found["recovered"] == equivalent


def test_half_a_pixel_costs_a_thin_figure_much_but_not_the_best_shift():
    truth = attractor.normalize(replace(codes.known("koch_curve"), probabilities=None))
    scores = judging.against_truth(truth.similar(1, (1 / 256, 0)), Truth((truth,)))
    assert scores["iou"] < 0.95 and scores["iou_1px"] > 0.98 and scores["f1_truth"] == 1
    far = judging.against_truth(truth.similar(1, (6 / 256, 0)), Truth((truth,)))
    assert far["iou_1px"] < 0.8 and far["iou"] < far["iou_1px"]


def test_what_has_no_code_is_judged_by_its_drawing_alone():
    square = np.array([[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]])
    truth = Truth((HALVES,), square)
    assert judging.true_drawing(truth, 64).sum() == pytest.approx(32**2, rel=0.08)
    assert judging.against_truth(HALVES, truth, 64)["recovered"] is None


def test_a_code_that_does_not_contract_draws_nothing():
    assert not judging.drawing(IFS(2 * torch.eye(2)[None], torch.zeros(1, 2)), 32).any()


def test_distances_of_known_points():
    true = np.array([[0.0, 0], [1, 0], [2, 0], [3, 0]])
    scores = judging.point_distances(true + [0, 0.1], true, 0.05, np.random.default_rng(0))
    assert scores["chamfer"] == pytest.approx(math.sqrt(2 * 0.1**2) / 2) and scores["hd95"] == pytest.approx(0.1)
    assert scores["covered"] == 1
    some = judging.point_distances(true[:2], true, 0.05, np.random.default_rng(0))
    assert some["covered"] == 0.5 and some["hd95"] == pytest.approx(np.quantile([0, 0, 1, 2], 0.95))


def test_density_maps_follow_their_law():
    params = density_maps.parameters(40)
    assert (params[:3] == density_maps.parameters(3)).all(), "a map does not depend on how many there are"
    linear, offset = density_maps.maps(params[0])
    singular = np.linalg.svd(linear, compute_uv=False)
    assert np.allclose(np.sort(singular, -1), np.sort(params[0][:, 2:4], -1))
    fixed = np.linalg.solve(np.eye(2) - linear, offset[..., None])[..., 0]
    assert np.abs(fixed).max() <= density_maps.FIXED
    assert (np.linalg.det(linear) > 0).all() and (params[..., 2:4] >= 0.2).all() and (params[..., 2:4] <= 0.7).all()


def test_a_density_agrees_with_itself_as_the_published_ones_do():
    """Yamaguti's floor is 2.9e-6: the summed squares between two densities of one code."""
    errors, rng = [], np.random.default_rng(0)
    for params in density_maps.parameters(6):
        code = density_maps.true_code(params)
        one, other = (density_maps.density(density_maps.points(code, rng)) for _ in range(2))
        assert one.shape == (128, 128) and one.sum() == pytest.approx(1)
        errors.append(np.square(one - other).sum())
    assert 1e-6 < np.mean(errors) < 6e-6


def test_a_density_s_first_index_is_x_and_its_picture_has_y_up():
    values = density_maps.density(np.full((100, 2), [1.0, -0.5]))
    r, c = np.unravel_index(values.argmax(), values.shape)
    assert (r, c) in {(106, 42), (106, 43), (107, 42), (107, 43), (106, 41)}
    row, column = np.unravel_index(density_maps.picture(values).argmax(), values.shape)
    assert (column, row) == (r, 127 - c)


def test_published_maps_are_read_from_a_file(tmp_path, monkeypatch):
    params = density_maps.parameters(2)
    path = tmp_path / "maps.npz"
    np.savez(path, params=params, density=np.ones((2, 128, 128)) / 128**2)
    monkeypatch.setenv(density_maps.VARIABLE, str(path))
    roles = SETS["density"].roles()
    assert roles["published-001"] == "reporting" and roles["own-000"] == "tuning" and "published-002" not in roles
    assert (density_maps.problem("published-001")[0] == params[1]).all()
    monkeypatch.delenv(density_maps.VARIABLE)
    with pytest.raises(InputError, match="--density-maps"):
        density_maps.problem("published-001")


def test_what_is_no_file_of_density_maps_is_refused(tmp_path):
    path = tmp_path / "maps.npz"
    np.savez(path, params=np.ones((2, 4, 6)))
    with pytest.raises(InputError, match="params and density"):
        density_maps.load(path)
    np.savez(tmp_path / "other.npz", params=np.ones((2, 4, 6)), density=np.ones((2, 64, 64)))
    with pytest.raises(InputError, match="got"):
        density_maps.load(tmp_path / "other.npz")


def test_a_true_code_scores_at_the_floor():
    set_ = SETS["density"]
    read = read_target(set_.picture("own-001"), density_maps.BINS, frame="keep")
    params, _ = density_maps.problem("own-001")
    framed = density_maps.true_code(params).similar(1 / density_maps.HALF_SIDE, (0, 0))
    scores = set_.score("own-001", framed, read)
    assert scores["exact"] and scores["sse"] < 2 * scores["floor_sse"] and (
        scores["covered"] > scores["floor_covered"] - 0.03)
    mask = judging.drawing(framed, density_maps.BINS)
    assert (mask & (read.image.numpy() > 0)).sum() > 0.95 * mask.sum(), "the picture lies as the code draws it"


def test_there_are_twenty_shapes_with_their_licences():
    assert len(shapes()) >= 20 and all(shape.licence for shape in shapes().values())


@pytest.mark.parametrize("name", sorted(GROWTH))
def test_grown_shapes_can_be_read_and_follow_their_seed(name):
    first, again, other = (shapes()[name].make(seed) for seed in (0, 0, 1))
    assert (first == again).all() and (first != other).any()
    assert 0.01 < (read_target(first, 256).image > 0.1).float().mean() < 0.4


@pytest.mark.parametrize("name", ["snowflake", "lily", "horse", "coastline", "flower"])
def test_other_shapes_can_be_read(name):
    assert 0.01 < (read_target(shapes()[name].make(0), 256).image > 0.1).float().mean() < 0.4


def test_water_runs_down_a_valley():
    x, y = np.meshgrid(np.arange(21.0), np.arange(30.0))
    streams = drainage(np.abs(x - 10) - 0.1 * y, least=60)
    assert streams[-1, 10] and streams[15, 10] and streams.sum(1).max() == 1
    hollow = np.abs(x - 10) - 0.1 * y
    hollow[20, 10] = -50  # a pit does not end the stream
    assert drainage(hollow, least=60)[-2, 10]


def test_a_paving_covers_the_shape_better_with_more_maps():
    picture = read_target(shapes()["shamrock"].make(0), 64).image.numpy()
    few, many = (judging.likeness(paving(judging.shape_of(picture), count), picture)["f1_input"] for count in (3, 30))
    assert 0.4 < few < many and many > 0.9
    assert len(paving(judging.shape_of(picture), 30)) <= 30 and len(paving(np.zeros((16, 16), bool), 4)) == 1


def test_the_true_code_of_the_binary_suite_is_exact():
    set_ = SETS["binary"]
    name = "suite-053"
    truth = attractor.normalize(binary.truth(name))
    scores = set_.score(name, truth, read_target(set_.picture(name), 256, frame="keep"))
    assert scores["exact"] and scores["f1_box"] > 0.97 and scores["f1_input"] > 0.9


def test_a_tone_curve_keeps_the_order_of_counts_and_its_true_code_is_recovered():
    seen = tone_curves.counts("fern", "tuning")
    assert seen.sum() == pytest.approx(tone_curves.WALKERS * tone_curves.STEPS, rel=1e-3)
    levels = {curve: draw(seen) for curve, draw in tone_curves.CURVES.items()}
    for curve, grey in levels.items():
        assert grey.min() == 0 and grey.max() == 1 and ((grey > 0) == (seen > 0)).all(), curve
        assert (np.diff(grey.flat[seen.argsort(axis=None)]) >= 0).all(), curve
    assert (levels["flame"] >= levels["logarithm"]).all()
    truth, other = tone_curves.truth("fern", "tuning"), tone_curves.truth("maple_leaf", "reporting")
    scores = SETS["tone_curves"].score("fern-flame", truth, None)
    assert scores["exact"] and scores.keys() & {*MAIN_SCORES}
    assert SETS["tone_curves"].score("fern-flame", other, None)["missed"] == 4


@pytest.mark.parametrize("name", ["gasket-4-black", "spiral_dots-blue"])
def test_a_redrawn_picture_shows_the_same_fractal_elsewhere(name):
    first, again = SETS["textbook"], SETS["textbook_redrawn"]
    assert first.roles() == again.roles()
    pictures = first.picture(name), again.picture(name)
    assert pictures[0].shape != pictures[1].shape or not np.array_equal(*pictures)
    for set_, picture in zip((first, again), pictures, strict=True):
        read = read_target(picture, 128)
        truth = textbook.pictures()[name].draw(0 if set_ is first else 1).truth_on(read.placement)
        assert set_.score(name, truth.code, read)["exact"]
