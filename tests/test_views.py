"""The views of a fractal: the same for every method, on the canvas, and spread as the protocol says."""

import numpy as np
import pytest

from fractal_exp import View, attractor
from fractal_exp.errors import InputError
from fractal_exp.evaluation.views import ZOOM_CLASSES, evaluation_views, views_seed, zoom_class
from fractal_exp.suite import random_suite

KINDS = ("paper", "released")


@pytest.mark.parametrize("kind", KINDS)
def test_seven_views_the_first_whole(kind):
    views = evaluation_views(3, kind)
    assert list(views) == ["whole", "1-2x-a", "1-2x-b", "2-4x-a", "2-4x-b", "4-8x-a", "4-8x-b"]
    assert views["whole"] == View()
    for name, view in views.items():
        assert name.startswith(zoom_class(view.zoom))


@pytest.mark.parametrize("kind", KINDS)
def test_windows_stay_on_the_canvas_and_fill_their_reach(kind):
    reaches, zooms = [], []
    for seed in range(300):
        for view in list(evaluation_views(seed, kind).values())[1:]:
            assert all(-1 - 1e-12 <= side <= 1 + 1e-12 for side in view.box)
            reach = (1 - 1 / view.zoom) / (1 if kind == "paper" else view.zoom)
            reaches.extend(c / reach for c in view.center)
            zooms.append(view.zoom)
    assert -1 <= min(reaches) < -0.99 and 0.99 < max(reaches) <= 1 + 1e-9
    assert abs(np.mean(reaches)) < 0.03 and np.var(reaches) == pytest.approx(1 / 3, rel=0.05)
    zooms = np.reshape(zooms, (300, 3, 2))
    for i, (low, high) in enumerate(((1, 2), (2, 4), (4, 8))):
        assert low <= zooms[:, i].min() and zooms[:, i].max() <= high
        assert zooms[:, i].mean() == pytest.approx((low + high) / 2, rel=0.03)


def test_views_are_pinned():
    view = evaluation_views(0)["4-8x-b"]
    assert (*view.center, view.zoom) == pytest.approx((0.5718998061443388, 0.06528920695491096, 4.702622482410236),
                                                      rel=1e-12)


def test_the_seed_depends_on_the_fractal_alone():
    a, b = random_suite(2)
    assert views_seed(a) == views_seed(attractor.normalize(a)) != views_seed(b)


def test_zoom_classes():
    assert [zoom_class(zoom) for zoom in (0.5, 1, 1.0001, 2, 2.5, 4, 7, 8, 100)] == [
        "whole", "whole", "1-2x", "1-2x", "2-4x", "2-4x", "4-8x", "4-8x", "4-8x"]
    assert ZOOM_CLASSES == ("whole", "1-2x", "2-4x", "4-8x")


def test_what_is_not_a_kind_of_views():
    with pytest.raises(InputError, match="paper, released"):
        evaluation_views(0, "mine")
    with pytest.raises(InputError, match="at least 0"):
        evaluation_views(-1)
