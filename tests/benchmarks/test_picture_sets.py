"""The sets of pictures from elsewhere: names, seeds, roles, and that every truth lies where its picture is."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from benchmarks.pictures import binary, density_maps, judging, tables, textbook, tone_curves, windows
from benchmarks.pictures.figures import FIGURES, Truth
from benchmarks.pictures.growth import GROWTH
from benchmarks.pictures.report import MAIN_SCORES
from benchmarks.pictures.sets import SETS
from benchmarks.pictures.shapes import shapes
from fractal_exp import IFS, InputError, codes
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import read_target

DEEPEST = {p.family: p for p in reversed(textbook.pictures().values()) if p.deepest and not p.jpeg}


@pytest.mark.parametrize("kind", [kind for kind in SETS if not kind.startswith("fractaldb")])  # its codes are not here
def test_every_set_has_pictures_for_tuning_and_for_reporting(kind, monkeypatch):
    monkeypatch.delenv(density_maps.VARIABLE, raising=False)
    only = {"density": {"tuning"}, "random_trees": {"reporting"}}  # those of density need the published file
    assert set(SETS[kind].roles().values()) == only.get(kind, {"tuning", "reporting"})


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


@pytest.mark.parametrize("family", [
    family if family in ("binary_tree_thinning", "carpet", "fern_dots", "koch_curve") else
    pytest.param(family, marks=pytest.mark.slow) for family in sorted(DEEPEST)])
def test_the_true_code_lies_on_its_picture(family):
    """Each lies within a pixel of the other; the thick trunk of a tree that thins out is one line of its truth."""
    drawn = DEEPEST[family].draw()
    target = read_target(drawn.pixels, 256)
    image = target.image.numpy()
    seen, true = image > 0.25 * image.max(), judging.true_drawing(drawn.truth_on(target.placement))
    assert (true & judging.thickened(seen)).sum() >= 0.95 * true.sum()
    assert (seen & judging.thickened(true)).sum() >= 0.97 * seen.sum()


@pytest.mark.parametrize("name", ["koch_filled-5-blue", "koch_filled-5-green", "carpet-5-red", "pentagon-6-orange"])
def test_both_tools_draw_where_the_truth_is(name):
    """To an eighth of a pixel: counting pixels from their corners or from their centres would make more."""
    drawn = textbook.pictures()[name].draw()
    x0, y0, x1, y1 = attractor.visible_box(drawn.truth_on(read_target(drawn.pixels, 256).placement).codes[0])
    assert max(abs(x0 + x1), abs(y0 + y1)) / 2 * 128 < 0.125


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


def test_density_maps_follow_their_law():
    params = density_maps.parameters(40)
    assert (params[:3] == density_maps.parameters(3)).all(), "a map does not depend on how many there are"
    linear, offset = density_maps.maps(params[0])
    singular = np.linalg.svd(linear, compute_uv=False)
    assert np.allclose(np.sort(singular, -1), np.sort(params[0][:, 2:4], -1))
    fixed = np.linalg.solve(np.eye(2) - linear, offset[..., None])[..., 0]
    assert np.abs(fixed).max() <= density_maps.FIXED
    assert (np.linalg.det(linear) > 0).all() and (params[..., 2:4] >= 0.2).all() and (params[..., 2:4] <= 0.7).all()


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


@pytest.mark.parametrize("name", [name if name in ("bush", "coral", "root") else
                                  pytest.param(name, marks=pytest.mark.slow) for name in sorted(GROWTH)])
def test_grown_shapes_can_be_read_and_follow_their_seed(name):
    first, again, other = (shapes()[name].make(seed) for seed in (0, 0, 1))
    assert (first == again).all() and (first != other).any()
    assert 0.01 < (read_target(first, 256).image > 0.1).float().mean() < 0.4


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


@pytest.mark.parametrize("name", ["cut-suite-002", "cut-gasket-8-blue", "zoom2-fern"])
def test_the_truth_of_a_part_lies_on_what_is_shown_of_it_and_goes_on_beyond(name):
    read = read_target(windows.part(name).pixels, 128)
    true = windows.truth(name, read)
    assert read.known is not None
    scores = windows.score(name, true, read)
    assert scores["f1_known"] == scores["f1_truth"] == 1 and scores["recovered"]
    drawn, mask = judging.drawing(true, 128), read.known.mask(128).numpy()
    assert judging.f1_within_a_pixel(judging.shape_of(read.image.numpy()) & mask, drawn & mask) > 0.9
    assert (drawn & ~mask).sum() > 0.05 * drawn.sum()   # the canvas does not hold all that lies outside


def test_a_part_is_continued_if_it_is_drawn_right_by_no_more_maps_than_the_truth_has():
    fits = pd.DataFrame({"f1_known": [1.0, 0.99, 1.0, 0.995], "maps": [3, 3, 4, 2], "true_maps": [3, 3, 3, 3]})
    assert tables.continued(fits).tolist() == [True, False, False, True]
