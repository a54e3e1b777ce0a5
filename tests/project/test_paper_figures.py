"""The pictures of the paper's studies: which views are marked, and which part of an enlarged picture is shown."""

import numpy as np
import pytest
import torch

from docs import paper_figures
from docs.figures import picture_of
from fractal_exp import View, codes, render
from fractal_exp.ifs import attractor
from fractal_exp.methods.super_resolution.enlarged import Enlarged

CARPET = attractor.normalize(codes.known("sierpinski_carpet"))


def test_only_a_view_without_all_its_points_is_marked():
    corner, hole = View((.74, .74), 64), View((0, 0), 64)
    whole, near = paper_figures.pair(CARPET, corner, 24)
    for picture, view in ((whole, View()), (near, corner)):
        assert np.array_equal(picture, picture_of(render(CARPET, view, resolution=48)))
    _, empty = paper_figures.pair(CARPET, hole, 24)
    assert set(np.unique(empty)) == {0, paper_figures.MARK}


def test_an_enlarged_picture_is_shown_around_the_middle_of_the_view():
    ramp = torch.linspace(0, 1, 2048).expand(2048, 2048)
    whole, near = paper_figures.enlarged(Enlarged(ramp, 8.0), View((.5, -.25), 64))
    assert whole.size == near.size == (2 * paper_figures.SIDE,) * 2
    left, right = (np.asarray(near)[:, column].mean() for column in (0, -1))
    assert [(grey / 255)**2 for grey in (left, right)] == pytest.approx([.75 - 1 / 128, .75 + 1 / 128], abs=.004)
