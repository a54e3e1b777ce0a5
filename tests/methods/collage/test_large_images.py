"""Large images: they are shrunk for the search, and the code is polished on the whole."""

import pytest
import torch
from collage_helpers import check_it_goes_on, distances, problem, small, tied

from fractal_exp import codes, suite
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.bins import binned
from fractal_exp.methods.collage.stages import plan_of
from fractal_exp.methods.collage.state import State

LARGE = {"stages": {"largest_side": 64, "full_side": 96}}  # with these, the triangle's image is a large one


@pytest.fixture(scope="module")
def whole_large(triangle):
    """What a search of a large picture tells, and the code that it returns."""
    told = []
    return told, small(**LARGE).reconstruct(triangle[1], on_step=told.append).code


@pytest.mark.parametrize("stage", [
    "full size", *(pytest.param(name, marks=pytest.mark.slow) for name in ("detail", "approach", "image"))])
def test_a_large_picture_interrupted_at_the_end_of_a_stage_goes_on_bit_for_bit(triangle, whole_large, tmp_path, stage):
    (_, image), (told, whole) = triangle, whole_large
    ends = [progress.stage for progress in told if progress.code is not None]
    assert ends[-5:] == ["detail", "approach", "image", "full size", "rounding"]
    check_it_goes_on(lambda: small(**LARGE), image, lambda told: told[-1].code is not None and told[-1].stage == stage,
                     tmp_path / "checkpoint", whole)


def test_a_large_picture_takes_the_rounds_it_is_given(triangle):
    _, image = triangle
    large = torch.nn.functional.interpolate(image[None, None], scale_factor=5)[0, 0]
    given = problem(large, levels="drawn", rounds=2, search={"restarts": 3}, camera={"curves": False,
                                                                                       "constructions": False})
    assert given.image.shape == (320, 320) and given.full_side == 640
    names = [stage.name for stage in plan_of(given).stages]
    once = ["search", "detail", "approach", "image"]
    assert names == ["search"] * 3 + once + ["search"] * 2 + once + ["full size", "rounding"]


@pytest.mark.parametrize("kind", ["grey", pytest.param("binary", marks=pytest.mark.slow)])
def test_a_large_picture_is_searched_small_and_polished_whole(kind):
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    image = suite.target(code, 600, kind)
    given = problem(image)
    assert given.image.shape == (300, 300)
    maps = affine.from_code(code) + 0.002 * torch.randn(3, 6, generator=torch.Generator().manual_seed(0))
    stage = plan_of(given).last[0]
    polished = stage.open(State(best=tied(maps))).now
    measure = binned(given.masses, 64)
    away = distances(polished.maps, affine.from_code(code), measure)
    assert stage.name == "full size" and float(away.diagonal().max()) * 300 < 0.3  # pixels of 600
    whole = problem(given.image)
    names = [each.name for each in plan_of(whole).stages]
    sought = [] if kind == "binary" else ["construction"]   # grey levels that were reduced look like a drawing's
    assert names == ["search", "search", "detail", *sought, "image", "rounding"]
