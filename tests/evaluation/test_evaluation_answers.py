"""Properties of evaluation that no table shows by itself: independent points, the limit of exactness, what a cached
image depends on, and which view is shown."""

from dataclasses import replace

import pytest
import torch
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from fractal_exp import View, codes
from fractal_exp.cli import configuration
from fractal_exp.evaluation import Perceptual, evaluate
from fractal_exp.evaluation.code_error import code_error
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import ReadImage
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.rendering.cache import ImageCache
from fractal_exp.studies.judging import judge
from fractal_exp.suite import random_suite, target
from fractal_exp.targets import SuiteFractal, Target


class Asked:
    """A picture of noise that keeps the views and seeds that it was asked for."""

    def __init__(self):
        self.views, self.seeds = [], []

    def render(self, view, *, resolution, seed, **_):
        self.views.append(view)
        self.seeds.append(seed)
        return torch.rand(resolution, resolution, generator=torch.Generator().manual_seed(seed))


def test_every_view_of_result_and_truth_has_points_of_its_own():
    result, truth = Asked(), Asked()
    evaluate(result, truth, resolution=32, seed=3, views="released")
    assert result.views == truth.views and len(result.views) > 1
    seeds = result.seeds + truth.seeds
    assert len(set(seeds)) == len(seeds)


def test_two_fractals_have_other_views_and_one_has_the_same_for_every_method():
    views = []
    for code in random_suite(2):
        first, second = Asked(), Asked()
        for result in (first, second):
            evaluate(result, code, resolution=32, points_in_view=1000, supersample=1)
        assert first.views == second.views
        views.append({(view.center, view.zoom) for view in first.views if view.zoom > 1})
    assert not views[0] & views[1]


@pytest.mark.parametrize(("pixels", "found"), [(0.1, True), (1.5, False)])
def test_a_map_one_and_a_half_pixels_off_is_not_found(pixels, found):
    triangle = attractor.normalize(codes.known("sierpinski_triangle"))
    off = torch.tensor([[0.0, 0], [0.6, 0.8], [0, 0]]) * pixels * 2 / 128
    error = code_error(replace(triangle, offset=triangle.offset + off), triangle, resolution=128,
                       points_in_view=200_000, align="none")
    assert (1 in error.missed) != found and (not error.exact or found)


SIZE = {"resolution": 32, "points_in_view": 3000, "supersample": 2, "seed": 5}
CHANGES = {
    "the seed": {"seed": 6}, "the number of points": {"points_in_view": 4000},
    "the parts of a pixel": {"supersample": 4},
    "the view": {"view": View((0.1, 0), 2)}, "the zoom": {"view": View((0, 0), 2)},
    "a matrix": {"linear": lambda code: code.linear * 0.9}, "an offset": {"offset": lambda code: code.offset + 0.1},
    "the chances": {"probabilities": lambda code: torch.tensor([0.8, 0.1, 0.1])},
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_cached_image_depends_on(what, tmp_path):
    code, kept, drawn = codes.known("sierpinski_triangle"), ImageCache(tmp_path), ImageCache(None)
    first = kept.render(code, View(), **SIZE)
    parts = {name: change(code) for name, change in CHANGES[what].items() if callable(change)}
    other, size = replace(code, **parts), SIZE | {name: value for name, value in CHANGES[what].items() if name in SIZE}
    view = CHANGES[what].get("view", View())
    expected = drawn.render(other, view, **size)
    assert not torch.equal(expected, first)
    for _ in range(2):  # drawn, and read
        torch.testing.assert_close(kept.render(other, view, **size), expected)
    torch.testing.assert_close(kept.render(code, View(), **SIZE), first)


@pytest.fixture(scope="module")
def options():
    """What `fractal-train` evaluates with, at a size that takes moments."""
    configuration.register()
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        config = configuration.resolve(compose("train", ["resolution=32", "evaluation.points_in_view=3000"]))
    return OmegaConf.to_container(config.evaluation)


def test_the_zoomed_picture_is_the_view_beyond_twice_that_shows_most(options):
    fern = codes.known("fern")
    aim = Target(ReadImage.of_drawing(target(fern, 32), "density"), fern)
    judged = judge(CodeReconstruction(attractor.normalize(fern)), aim, options, Perceptual("none"), 1.0)
    zoomed = judged.pictures["zoomed_target"]
    shown = float((zoomed > 0).float().mean())
    asked = Asked()
    evaluate(asked, fern, **options)
    lit = [float((ImageCache(None).render(attractor.normalize(fern), view, resolution=32, points_in_view=3000,
                                          supersample=options["supersample"], seed=0) > 0).float().mean())
           for view in asked.views if view.zoom > 2]
    assert shown == pytest.approx(max(lit), abs=0.03) and max(lit) > min(lit) + 0.1


@pytest.mark.parametrize("kind", ["grey", "binary"])
def test_a_target_of_the_suite_is_the_fractal_of_its_index_seed_and_kind(kind):
    source = SuiteFractal(2, seed=7, kind=kind)
    code = random_suite(3, seed=7)[2]
    loaded = source.load(32)
    assert torch.equal(loaded.truth.linear, code.linear) and torch.equal(loaded.truth.offset, code.offset)
    assert torch.equal(loaded.image, target(code, 32, kind))
    assert "7" in source.label and "2" in source.label
