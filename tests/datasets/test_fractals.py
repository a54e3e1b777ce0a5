"""Pictures of a data set: their points, frame and pixels, their instances, and that they are the same every time."""

import math
import pickle

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from fractal_exp import IFS, InputError, codes
from fractal_exp.datasets import Fractals, kernels
from fractal_exp.datasets.fractals import factors
from fractal_exp.ops.histogram.pool import choice

SMALL = {"size": 32, "points": 2000}
STRETCHING = IFS([[[1.1, 0.1], [0, 0.3]], [[0.3, 0], [0.1, 1.1]]], [[0.5, 0], [0, 0.5]], [0.5, 0.5])


def code_of_one_map(matrix, offset) -> IFS:
    """Its chaos game leaves nothing to chance."""
    return IFS([matrix], [offset])


def marked(xs, ys, kind, size=22, tone=1.0, seed=1):
    image = np.zeros((size, size), np.uint8)
    kernels.mark(np.array(xs, float), np.array(ys, float), np.uint64(seed), kind, tone, image)
    return image


def drawn(rows, probabilities, points):
    (xs, ys), image = np.full((2, points), -1e40), np.zeros((32, 32), np.uint8)
    count = kernels.draw(np.array(rows, float), *choice(np.array(probabilities)), np.uint64(3), kernels.POINTS, 1.0, xs,
                         ys, image)
    return np.stack([xs, ys], 1), count, image


def test_each_point_is_the_image_of_the_one_before_under_a_map_as_probable_as_it_should_be():
    rows = [[0.5, 0, 0, 0.5, 0, 0], [9, 0, 0, 9, 5, 5], [0.5, 0, 0, 0.5, 1, 0], [0.5, 0, 0, 0.5, 0, 1], [7] * 6]
    points, count, _ = drawn(rows, [1, 0, 2, 5, 0], 40_000)
    steps = np.rint(points[1:] - 0.5 * points[:-1]).astype(int)
    assert count == len(points) and (points[0] == 0).all()
    np.testing.assert_allclose(points[1:], 0.5 * points[:-1] + steps)
    share = [(steps == offset).all(1).mean() for offset in ((0, 0), (1, 0), (0, 1))]
    np.testing.assert_allclose(share, [1 / 8, 2 / 8, 5 / 8], atol=0.01)


def test_a_game_that_runs_away_ends_far_out():
    points, count, image = drawn([[2, 0, 0, 2, 1, 0]], [1], 1000)
    assert points[count - 1, 0] == 2.0**(count - 1) - 1 and 2.0**(count - 1) < kernels.FAR < 2.0**(count + 1)
    assert (points[count:] == -1e40).all() and (image == marked(*points[:count].T, kernels.POINTS, 32)).all()


def test_the_outermost_points_lie_at_the_margin_and_y_points_upwards():
    image = marked([0, 8, 4, 1], [-1, 1, 0, -1], kernels.POINTS)
    assert sorted(zip(*map(np.ndarray.tolist, image.nonzero()), strict=True)) == [(5, 16), (10, 11), (15, 6), (15, 7)]
    assert set(np.unique(image)) == {0, 127}
    assert (marked([3, 3], [-1, 1], kernels.POINTS).nonzero()[1] == 11).all()  # without width: in the middle


def test_the_pixels_are_those_of_the_formula_of_fractaldb():
    xs, ys = np.random.default_rng(0).normal(size=(2, 5000))
    column, row = (np.uint16((v - v.min()) / (v - v.min()).max() * float(64 - 12) + 6.0) for v in (xs, ys))
    expected = np.zeros((64, 64), np.uint8)
    expected[row, column] = 127
    assert (marked(xs, ys, kernels.POINTS, 64) == expected[::-1]).all()


def test_a_patch_has_at_least_one_of_nine_dots_at_random_and_covers_what_was_there():
    patches = np.stack([marked([0], [0], kernels.PATCHES, seed=seed) for seed in range(3000)]) / 127
    row, column = 22 - 1 - 11, 11
    inside = patches[:, row - 3:row, column + 1:column + 4]
    assert patches.sum() == inside.sum() and (inside.sum((1, 2)) > 0).all()
    np.testing.assert_allclose(inside.mean(0), 256 / 511, atol=0.04)
    dots = marked([0] * 50, [0] * 50, kernels.PATCHES)  # of fifty patches, one on the other, the last is seen
    assert 0 < (dots > 0).sum() < 9


def test_a_density_shows_how_many_points_a_pixel_has():
    image = marked([0] * 3 + [1] * 40 + [2], [0] * 44, kernels.DENSITY, tone=0.25)
    levels = image[image > 0].tolist()
    assert levels == [round(255 * (1 - math.exp(-0.25 * count))) for count in (3, 40, 1)]


@pytest.mark.parametrize("workers", [1, 2])
def test_the_batches_are_the_same_for_any_number_of_workers(workers):
    def batches(workers):
        fractals = Fractals([codes.known("fern"), STRETCHING], batch=30, repeats=1, **SMALL)
        return list(DataLoader(fractals, batch_size=None, num_workers=workers))

    alone, several = batches(0), batches(workers)
    assert len(alone) == len(several) == 7
    for (images, labels), (others, other_labels) in zip(alone, several, strict=True):
        assert torch.equal(images, others) and torch.equal(labels, other_labels)
    images, labels = (torch.cat(each) for each in zip(*alone, strict=True))
    assert images.shape == (200, 1, 32, 32) and images.dtype == torch.uint8
    assert labels.dtype == torch.int64 and labels.bincount().tolist() == [100, 100]
    assert labels[:50].unique().tolist() == [0, 1]  # in random order


def test_a_data_set_travels_to_a_worker_that_is_not_forked():
    fractals = Fractals([STRETCHING], probabilities="random", **SMALL)
    assert (pickle.loads(pickle.dumps(fractals)).picture(7) == fractals.picture(7)).all()


def test_epochs_and_seeds_have_other_drawings_in_another_order():
    fractals = Fractals([STRETCHING], **SMALL)
    first, order = fractals.picture(7), fractals.order()
    assert (Fractals([STRETCHING], **SMALL).picture(7) == first).all()
    assert (Fractals([STRETCHING], seed=1, **SMALL).picture(7) != first).any()
    fractals.set_epoch(1)
    assert (fractals.picture(7) != first).any() and (fractals.order() != order).any()
    assert sorted(fractals.order()) == list(range(1000))


def test_four_pictures_are_the_flips_of_one_drawing_and_the_next_four_of_another():
    fractals = Fractals([codes.known("fern")], repeats=2, **SMALL)
    pictures = [fractals.picture(index) for index in range(8)]
    for picture, flipped in zip(pictures, (pictures[0], pictures[0][::-1], pictures[0][:, ::-1],
                                           pictures[0][::-1, ::-1]), strict=False):
        assert (picture == flipped).all()
    assert (pictures[4] != pictures[0]).any()


def test_jitter_multiplies_an_entry_at_a_time_as_the_files_of_fractaldb_do():
    table = factors(0.4)
    assert table.shape == (25, 6) and factors(0.0).tolist() == [[1.0] * 6]
    np.testing.assert_allclose(table[:6, :2], [[0.2, 1], [0.6, 1], [1, 1], [1.4, 1], [1.8, 1], [1, 0.2]])
    assert factors(0.5)[0, 0] == 0.01 and ((table != 1).sum(1) == [0 if k == 2 else 1 for k in range(25)]).all()
    matrix, offset = [[0.5, 0.3], [-0.3, 0.6]], [0.2, 1.0]
    jittered = Fractals([code_of_one_map(matrix, offset)], jitter=0.4, repeats=1, flips=False, draw="points", **SMALL)
    by_hand = code_of_one_map([[0.5, 0.3], [-0.3 * 1.4, 0.6]], offset)
    alone = Fractals([by_hand], jitter=0, repeats=1, flips=False, draw="points", **SMALL)
    way = table.tolist().index([1, 1, 1.4, 1, 1, 1])
    assert (jittered.pictures, alone.pictures) == (25, 1)
    assert (jittered.picture(way) == alone.picture(0)).all() and (jittered.picture(2) != alone.picture(0)).any()


def test_probabilities_of_an_instance():
    code = IFS([[[0.5, 0], [0, 0.5]]] * 4, [[0, 0], [1, 0], [0, 1], [1, 1]], [0.97, 0.01, 0.02, 0.0])
    corners = {}
    for kind in ("own", "areas", "random"):
        fractals = Fractals([code], size=44, points=30_000, draw="density", jitter=0, repeats=2, flips=False,
                            probabilities=kind)
        third = slice(6, 22), slice(6, 22)  # the corner of the third map
        corners[kind] = [fractals.picture(index)[third].astype(int).sum() for index in range(2)]
        assert not fractals.picture(0)[6:20, 24:38].any()  # of the fourth, which is never chosen
    assert max(corners["own"]) < min(corners["areas"]) / 4
    assert abs(np.subtract(*corners["random"])) > 4 * abs(np.subtract(*corners["areas"]))


def test_a_code_that_stretches_and_contracts_on_average_fills_its_frame():
    picture = Fractals([STRETCHING], draw="points", jitter=0, size=64, points=20_000).picture(0)
    rows, columns = picture.nonzero()
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (5, 57, 6, 58) and len(rows) > 100


@pytest.mark.parametrize(("options", "message"), [
    ({"codes": []}, "at least one code"),
    ({"codes": [code_of_one_map([[1.1, 0], [0, 1]], [1, 0])]}, "code 1 does not contract, not even on average"),
    ({"size": 15}, "size must be an integer of at least 16"),
    ({"size": 5000}, "size must be an integer of at most 4096"),
    ({"points": 1}, "points"), ({"batch": 0}, "batch"), ({"repeats": 0}, "repeats"), ({"seed": -1}, "seed"),
    ({"jitter": 0.6}, "jitter must be a number from 0 to 0.5"), ({"jitter": math.nan}, "jitter"),
    ({"draw": "point"}, "draw must be one of points, patches, density, got 'point'; did you mean 'points'"),
    ({"probabilities": "mine"}, "probabilities must be one of own, areas, random"),
])
def test_what_cannot_be_drawn_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        Fractals(**{"codes": [STRETCHING]} | options)
