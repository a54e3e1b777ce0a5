"""The distance `fractal`: its values, the file in the package, and its bad twins."""

from importlib import resources

import pytest
import torch
from safetensors.torch import load_file

from benchmarks.perceptual_training.network import Learner
from fractal_exp import InputError, perceptual_distance
from fractal_exp.perceptual import distances as perceptual
from fractal_exp.perceptual import fractal_features
from fractal_exp.perceptual.feature_distance import unit_distance
from fractal_exp.runtime import weights

SMALLEST = fractal_features.SMALLEST_PX
SHIPPED = f"{fractal_features.NAME}.safetensors"


def images(*shape, seed=0, dtype=torch.float32):
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed), dtype=dtype)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A whole weight file of another network than the shipped one."""
    learner = Learner(0, torch.Generator().manual_seed(1))
    return fractal_features.save(tmp_path_factory.mktemp("weights") / "mine.safetensors", *learner.export(1.0),
                                 {"steps": 0})


def altered(file, path, **changes):
    """A copy of a weight file with some tensors changed, or without them (None)."""
    tensors = load_file(file)
    for name, change in changes.items():
        name = name.replace("__", ".")
        tensors[name] = change and change(tensors[name])
    return weights.save(path, fractal_features.NAME, {name: value for name, value in tensors.items()
                                                      if value is not None}, {}, {})


# --- values ---------------------------------------------------------------------------------------------------------

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


@pytest.mark.parametrize("batches", [((), ()), ((3,), ()), ((), (3,)), ((2, 1), (3,)), ((1,), (2, 3)), ((0,), ())])
def test_the_gradients_are_those_of_the_formula(batches):
    a, b = ([images(*batch, channels, side, side, seed=seed, dtype=torch.float64).requires_grad_()
             for channels, side in ((8, 9), (24, 5))] for seed, batch in enumerate(batches))
    weights = [images(count, seed=count, dtype=torch.float64) for count in (8, 24)]
    expected = sum((w[:, None, None] * (x / x.norm(dim=-3, keepdim=True) - y / y.norm(dim=-3, keepdim=True)) ** 2)
                   .sum(-3).mean((-2, -1)) for x, y, w in zip(a, b, weights, strict=True))
    found, cotangent = unit_distance(a, b, weights), images(*torch.broadcast_shapes(*batches), seed=7).double()
    torch.testing.assert_close(found, expected)
    for own, twin in zip(*(torch.autograd.grad(d, [*a, *b], cotangent) for d in (found, expected)), strict=True):
        torch.testing.assert_close(own, twin)


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


@pytest.mark.parametrize("shape", [(0, 40, 40), (2, 0, 3, 40, 40), (40, 0)])
def test_no_images(shape):
    full = images(40, 40)
    for pair, name in (((torch.zeros(shape), full), "a"), ((full, torch.zeros(shape)), "b")):
        with pytest.raises(InputError, match=f"{name} must hold at least one image"):
            perceptual_distance(*pair)


def test_the_released_range_is_what_this_distance_is_fed_with_anyway():
    pair = images(40, 40, seed=1), images(40, 40, seed=2)
    one, other = (perceptual.load("fractal", input_range=name)(*pair) for name in ("correct", "released"))
    assert torch.equal(one, other) and float(one) > 0


@pytest.mark.parametrize("name, change, message", [
    ("layers__2__weight", lambda x: x[:, :4].contiguous(), "layers.2.weight: 24×4×3×3, expected 24×8×3×3"),
    ("layers__4__bias", None, "layers.4.bias: absent, expected 48"),
    ("layers__0__bias", lambda x: x * float("nan"), "NaN or infinite values in layers.0.bias"),
    ("channel_weights__1", lambda x: -x, "channel_weights.1 must not be negative")])
def test_a_file_of_another_network(file, tmp_path, name, change, message):
    with pytest.raises(InputError, match=message):
        perceptual.load("fractal", altered(file, tmp_path / "x.safetensors", **{name: change}))


def test_the_file_in_the_package_is_small_and_whole():
    assert (resources.files("fractal_exp") / "data" / SHIPPED).stat().st_size <= 4e6
    assert fractal_features.load().recipe["steps"] > 0
