"""Large images: they are shrunk for the search, and the code is polished on the whole."""

import pytest
import torch
from collage_helpers import PARAMS, problem, small, tied

from fractal_exp import codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.bins import binned
from fractal_exp.methods.collage.stages.image import last_stages, stages_of
from fractal_exp.methods.collage.state import State
from fractal_exp.runtime.checkpoint import Checkpoint

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

    def interrupt(progress):
        if progress.code is not None and progress.stage == stage:
            raise KeyboardInterrupt

    path = tmp_path / "checkpoint.safetensors"
    with pytest.raises(KeyboardInterrupt):
        small(**LARGE).reconstruct(image, on_step=interrupt, checkpoint=Checkpoint(path))
    resumed = small(**LARGE).reconstruct(image, checkpoint=Checkpoint(path, resume=True)).code
    assert torch.equal(whole.linear, resumed.linear) and torch.equal(whole.offset, resumed.offset)


def test_a_large_picture_takes_the_rounds_it_is_given(triangle):
    _, image = triangle
    large = torch.nn.functional.interpolate(image[None, None], scale_factor=5)[0, 0]
    given = problem(large, levels="coverage", rounds=2, search={"restarts": 3}, camera={"grey_inside": 1.0})
    assert given.image.shape == (320, 320) and given.full_side == 640
    names = [s.name for number in range(2) for s in stages_of(given, number)] + [s.name for s in last_stages(given)]
    once = ["search", "detail", "approach", "image"]
    assert names == ["search"] * 3 + once + ["search"] * 2 + once + ["full size", "rounding"]


@pytest.mark.parametrize("kind", ["grey", pytest.param("binary", marks=pytest.mark.slow)])
def test_a_large_picture_is_searched_small_and_polished_whole(kind):
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    image = suite.target(code, 600, kind)
    given = problem(image)
    assert given.image.shape == (300, 300)
    maps = affine.from_code(code) + 0.002 * torch.randn(3, 6, generator=torch.Generator().manual_seed(0))
    stage, state = last_stages(given)[0], State(best=tied(maps))
    stage.open(state)
    measure = binned(given.masses, 64, PARAMS.descent)
    away = affine.distances(stage.begin(state).maps, affine.from_code(code), measure)
    assert stage.name == "full size" and float(away.diagonal().max()) * 300 < 0.3  # pixels of 600
    whole = problem(given.image)
    names = [each.name for each in (*stages_of(whole, 0), *last_stages(whole))]
    sought = [] if kind == "binary" else ["construction"]   # grey levels that were reduced look like a drawing's
    assert names == ["search", "search", "detail", *sought, "image", "rounding"]
