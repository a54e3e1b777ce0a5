"""Super-resolution: its network, its views up to eightfold, how it is judged, and what it refuses."""

import dataclasses

import pytest
import torch
from networks_helpers import SUPER, saved
from rivals_helpers import TARGET

from fractal_exp import InputError, codes, evaluation
from fractal_exp.evaluation import Perceptual, score
from fractal_exp.ifs.code import View
from fractal_exp.images.reading import ReadImage
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.methods.super_resolution.enlarged import Enlarged
from fractal_exp.methods.super_resolution.method import SuperResolution
from fractal_exp.methods.super_resolution.network import SwinIR
from fractal_exp.studies.judging import judge
from fractal_exp.targets import Target
from fractal_exp.training.super_resolution import SuperResolutionRecipe, SuperResolutionTraining

TRUTH = codes.known("sierpinski_triangle")
OPTIONS = {"resolution": 32, "points_in_view": 20_000, "supersample": 4, "views": "attractor", "align": "bbox",
           "device": "cpu"}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return str(saved(tmp_path_factory.mktemp("weights") / "net.safetensors", "super_resolution"))


def random_image(side: int):
    return torch.rand(side, side, generator=torch.Generator().manual_seed(1))


def test_the_network_of_the_paper_is_that_of_swinir():
    recipe = SuperResolutionRecipe()
    network = SwinIR(recipe.width, recipe.groups, recipe.layers, recipe.heads, recipe.window, recipe.features, 8)
    blocks = [block for group in network.deep for block in group.blocks]
    assert len(blocks) == 36 and [block.attn.shift_size for block in blocks[:3]] == [[0, 0], [4, 4], [0, 0]]
    assert blocks[0].attn.qkv.weight.shape == (540, 180) and blocks[0].mlp[0].weight.shape == (360, 180)
    assert 11e6 < sum(value.numel() for value in network.parameters()) < 13e6, "11.9 million in Liang et al."


@pytest.mark.parametrize("factor", [2, 8])
def test_an_image_is_enlarged_whatever_its_size(factor):
    network = SwinIR(8, 1, 2, 2, 4, 2, factor)
    assert network(torch.rand(2, 9, 13)).shape == (2, 9 * factor, 13 * factor)


def test_the_whole_view_of_an_enlarged_image_is_its_mean():
    image = random_image(64)
    whole = Enlarged(image, 8.0).render(View(), resolution=8)
    assert torch.allclose(whole, image.view(8, 8, 8, 8).mean((1, 3)), atol=1e-6)
    assert torch.equal(Enlarged(image, 8.0).render(View(), resolution=64), image)


def test_a_view_is_the_part_that_it_shows():
    image = random_image(64)
    # The window [0, .5] x [.25, .75] is columns 32 to 48 and rows 8 to 24.
    part = Enlarged(image, 8.0).render(View((.25, .5), 4.0), resolution=16)
    assert torch.allclose(part, image[8:24, 32:48], atol=1e-6)
    finer = Enlarged(image, 8.0).render(View((.25, .5), 4.0), resolution=32)
    assert torch.allclose(finer[::2, 1::2], image[8:24, 32:48], atol=1e-6)


def test_pieces_to_learn_from_are_the_same_place_fine_and_coarse():
    training = SuperResolutionTraining(**SUPER | {"supersample": 8, "batch": 8, "codes": 8})
    coarse, fine = training.batch(0)
    assert coarse.shape == (8, 8, 8) and fine.shape == (8, 64, 64)
    assert 0 <= float(fine.min()) and float(fine.max()) <= 1
    mean = fine.view(8, 8, 8, 8, 8).mean((2, 4))
    for k in range(8):
        together = torch.corrcoef(torch.stack([coarse[k].flatten(), mean[k].flatten()]))[0, 1]
        assert together > .8, "the means of the fine piece are about the coarse one"
        assert float((mean[k].mean() - coarse[k].mean()).abs()) < .15


def test_views_that_it_cannot_show_are_left_out_and_counted():
    fourfold, whole = Enlarged(TARGET, 4.0), CodeReconstruction(TRUTH)
    target, none = Target(ReadImage.of_drawing(TARGET, "density"), TRUTH), Perceptual.load()
    judged = judge(fourfold, target, OPTIONS, none, 1.0, ceiling=True)
    assert judged.counts["views/left_out"] == 2 and len(judged.per_view) == 5
    assert judged.per_view["zoom"].max() <= 4 and "2 more are left out, as they are closer by" in judged.describe()
    every = judge(whole, target, OPTIONS, none, 1.0, ceiling=True)
    assert "views/left_out" not in every.counts and "left out" not in every.describe() and len(every.per_view) == 7
    again = score(TRUTH, TRUTH, **OPTIONS).frame
    assert judged.trivial["trivial/truth_f1"] == pytest.approx(again["f1"][again["zoom"] <= 4].mean())
    table = evaluation.evaluate(fourfold, TRUTH, **OPTIONS)
    assert table.attrs["left_out"] == ["4-8x-a", "4-8x-b"]
    eightfold = dataclasses.replace(fourfold, largest_zoom=8.0)
    assert evaluation.evaluate(eightfold, TRUTH, **OPTIONS).attrs["left_out"] == []
    with pytest.raises(InputError, match="no view to judge by: the reconstruction only shows zooms up to 0.5"):
        score(dataclasses.replace(fourfold, largest_zoom=.5), TRUTH, **OPTIONS)


def test_small_images_and_options_out_of_range_are_refused(file):
    with pytest.raises(InputError, match="sees 16² pixels at least, and the target has 8²; raise resolution to 16"):
        SuperResolution(weights=file).check(random_image(8))
    for options, message in (({"seconds": 0}, "seconds must be above 0"), ({"tile": 0}, "tile must be at least 16"),
                             ({"tiles": 64}, "did you mean 'tile'")):
        with pytest.raises(InputError, match=message):
            SuperResolution(**options)


@pytest.mark.slow
def test_the_network_in_the_package_is_nearer_than_bicubic_interpolation():
    """On codes of a seed that it was not trained with."""
    network, found = SuperResolution().loaded()
    assert found.recipe["seed"] == 0 and found.scores["held_out"] < found.scores["bicubic"]
    sizes = {key: found.recipe[key] for key in ("side", "patch", "supersample")}
    training = SuperResolutionTraining(**sizes, seed=1)
    with torch.no_grad():
        scores = training.judge(network, "cpu")
    assert scores["held_out"] < .97 * scores["bicubic"]
