"""The distance `fractal`: its values, the file in the package, and its bad twins."""

import hashlib
import shutil
from importlib import resources

import numpy as np
import pytest
import torch

from fractal_exp import InputError, perceptual_distance
from fractal_exp.codes import known
from fractal_exp.evaluation import evaluate, summarize
from fractal_exp.evaluation.scoring import Perceptual
from fractal_exp.perceptual import distances as perceptual
from fractal_exp.perceptual import fractal_features
from fractal_exp.perceptual.feature_distance import unit_distance
from fractal_exp.perceptual_training.network import Learner

SMALLEST = fractal_features.SMALLEST_PX


def images(*shape, seed=0, dtype=torch.float32):
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed), dtype=dtype)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A whole weight file of another network than the shipped one."""
    learner = Learner(0, torch.Generator().manual_seed(1))
    return fractal_features.save(tmp_path_factory.mktemp("weights") / "mine.safetensors", *learner.export(1.0),
                                 {"steps": 0})


# --- values ---------------------------------------------------------------------------------------------------------

def test_equal_images_are_at_distance_zero_and_others_are_not():
    a, b = images(2, 64, 64)
    assert float(perceptual_distance(a, a)) == 0
    assert float(perceptual_distance(a, b)) > 1e-3


def test_it_is_lpips_construction_on_the_levels_of_the_network(file):
    found, (a, b) = fractal_features.load(file), images(2, 70, 70)
    expected, x, y = 0.0, a[None, None], b[None, None]
    for count, layer in enumerate(found.layers, 1):
        x, y = layer(x), layer(y)
        if count in fractal_features.TAPS:
            level = found.channel_weights[fractal_features.TAPS.index(count)]
            apart = (torch.nn.functional.normalize(x) - torch.nn.functional.normalize(y)).square()
            expected += float((apart * level[None, :, None, None]).sum(1).mean().detach())
    assert float(perceptual.load("fractal", file)(a, b)) == pytest.approx(expected, rel=1e-4)
    assert len(fractal_features.TAPS) >= 4


@pytest.mark.parametrize("size", [(SMALLEST, SMALLEST), (SMALLEST + 1, SMALLEST + 6)])
@pytest.mark.parametrize("which", [0, 1])
def test_gradients_agree_with_finite_differences(file, which, size):
    pair, direction = list(images(2, *size, dtype=torch.float64)), images(*size, seed=3)
    distance, step = perceptual.load("fractal", file).double(), 1e-6
    pair[which].requires_grad_()
    (gradient,) = torch.autograd.grad(distance(*pair), pair[which])
    with torch.no_grad():
        ends = [distance(*(x + sign * step * direction * (k == which) for k, x in enumerate(pair))) for sign in (1, -1)]
    assert float((gradient * direction).sum()) == pytest.approx(float(ends[0] - ends[1]) / (2 * step), rel=1e-5)


@pytest.mark.parametrize("layout", [torch.contiguous_format, torch.channels_last])
@pytest.mark.parametrize("batches", [((), ()), ((3,), ()), ((), (3,)), ((2, 1), (3,)), ((1,), (2, 3)), ((0,), ())])
def test_the_kernels_agree_with_their_torch_twins(batches, layout):
    a, b = ([images(*batch, channels, side, side, seed=seed) for channels, side in ((8, 9), (24, 5))]
            for seed, batch in enumerate(batches))
    a[0][..., 2, 2] = 0  # a pixel without features
    weights, found = [images(8, seed=5), images(24, seed=6)], []
    for dtype in torch.float32, torch.float64:  # the kernels take single precision alone
        sides = [[laid_out(level.to(dtype), layout).requires_grad_() for level in side] for side in (a, b)]
        distance = unit_distance(*sides, [weight.to(dtype) for weight in weights])
        cotangent = images(*distance.shape, seed=7).to(dtype)
        found.append([distance, *torch.autograd.grad(distance, [*sides[0], *sides[1]], cotangent)])
    assert found[0][0].shape == torch.broadcast_shapes(*batches)
    for own, twin in zip(*found, strict=True):
        assert own.isfinite().all()
        known = twin.abs() < 1e6  # where all features are 0 it is 10¹⁰, for a ReLU to undo
        torch.testing.assert_close(own[known], twin[known].float(), rtol=1e-4, atol=1e-6)


def laid_out(level, layout):
    """(…,C,h,w) in this memory format."""
    return level.flatten(0, -4).contiguous(memory_format=layout).view_as(level) if level.ndim > 3 else (
        level[None].contiguous(memory_format=layout)[0])


@pytest.mark.parametrize("batches", [((), ()), ((3,), ()), ((), (3,))])
def test_single_precision_has_the_gradients_of_double_precision(batches):
    pair = [images(*batch, 47, 41, seed=seed) for seed, batch in enumerate(batches)]
    gradients = []
    for dtype in torch.float32, torch.float64:
        inputs = [image.to(dtype).requires_grad_() for image in pair]
        distance = perceptual.load("fractal").to(dtype)
        gradients.append(torch.autograd.grad(distance(*inputs).sum(), inputs))
    for own, twin in zip(*gradients, strict=True):
        torch.testing.assert_close(own, twin.float(), rtol=1e-3, atol=1e-3 * float(twin.abs().max()))


def level(*batch, channels=8, side=6):
    return images(*batch, channels, side, side)


@pytest.mark.parametrize(("a", "b", "weights", "message"), [
    ([level()], [level(side=9)], [images(8)], "draw both images at one resolution"),
    ([level()], [level()], [images(7)], r"got \(8, 6, 6\), \(8, 6, 6\) and \(7,\) weights"),
    ([level()], [level()], [images(8)] * 2, "got 1 and 1 for 2"),
    ([level(), level(2)], [level(), level(2)], [images(8)] * 2, "one batch"),
])
def test_features_that_do_not_go_together_are_refused(a, b, weights, message):
    with pytest.raises(InputError, match=message):
        unit_distance(a, b, weights)


def test_it_has_a_column_of_its_own():
    assert Perceptual.load("fractal").column == "fractal_distance"
    code = known("fern")
    summary = summarize(evaluate(code, code, resolution=64, points_in_view=50_000, perceptual="fractal"))
    lines = summary[summary.zoom_class == "all"].set_index("metric")
    assert lines.loc["fractal_distance", "mean"] < 0.1 and set(lines.fractals) == {1} and set(lines["views"]) == {7}
    assert np.isnan(lines.loc["lpips", "mean"])


# --- bad input ------------------------------------------------------------------------------------------------------


def test_images_that_do_not_go_together():
    a = images(40, 40)
    with pytest.raises(InputError, match="agree in size, device and dtype"):
        perceptual_distance(a, images(41, 41))
    with pytest.raises(InputError, match="agree in size, device and dtype"):
        perceptual_distance(a, a.double())
    with pytest.raises(InputError, match="tensor of floats"):
        perceptual_distance(a.numpy(), a)
    with pytest.raises(InputError, match=r"batches of a and b must broadcast, got \(2, 40, 40\) and \(3, 40, 40\)"):
        perceptual_distance(images(2, 40, 40), images(3, 40, 40))


def test_the_file_in_the_package_is_small_and_whole():
    data = (resources.files("fractal_exp") / "data" / fractal_features.SHIPPED).read_bytes()
    assert len(data) <= 4e6 and hashlib.sha256(data).hexdigest() == fractal_features.SHIPPED_SHA256
    assert fractal_features.load().recipe["steps"] > 0


def test_a_damaged_or_missing_file_in_the_package(monkeypatch, tmp_path):
    shipped = resources.files("fractal_exp.data") / fractal_features.SHIPPED
    monkeypatch.setattr(fractal_features.resources, "files", lambda _: tmp_path)
    with pytest.raises(InputError, match="lacks its weight file.*perceptual_weights=PATH"):
        perceptual.load("fractal")
    copy = tmp_path / fractal_features.SHIPPED
    shutil.copy(shipped, copy)
    perceptual.load("fractal")
    copy.write_bytes(copy.read_bytes()[:-1] + b"x")
    with pytest.raises(InputError, match="is damaged: its SHA-256"):
        perceptual.load("fractal")
