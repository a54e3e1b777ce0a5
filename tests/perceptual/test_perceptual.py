"""LPIPS against the lpips package, its weight files, and everything that can be wrong with them."""

import os
import shutil
import warnings
from pathlib import Path
from urllib.error import URLError

import pytest
import torch
from torchvision.models import get_model

from fractal_exp.errors import InputError
from fractal_exp.methods.chaotic.losses import PerceptualTerm
from fractal_exp.methods.chaotic.rendering import Rendering
from fractal_exp.perceptual import distances as perceptual
from fractal_exp.perceptual.distances import WeightsUnavailable

MODELS = {"lpips_alex": "alexnet", "lpips_squeeze": "squeezenet1_1", "lpips_vgg": "vgg16"}
SMALLEST_PX = {"lpips_alex": 31, "lpips_squeeze": 17, "lpips_vgg": 16}
each_kind = pytest.mark.parametrize("kind", MODELS)


def random_features(kind):
    """A `features` state dict of the right shapes with seeded random weights; for tests alone."""
    generator = torch.Generator().manual_seed(0)
    with torch.device("meta"):
        expected = get_model(MODELS[kind], weights=None).features.state_dict()
    state = {}
    for name, value in expected.items():
        spread = (2 / value[0].numel()) ** 0.5 if value.ndim == 4 else 0.1
        state[name] = spread * torch.randn(value.shape, generator=generator)
    return state


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """Files of random features, by kind, written once."""
    folder, files = tmp_path_factory.mktemp("weights"), {}
    for kind in MODELS:
        files[kind] = folder / f"{kind}.pth"
        torch.save(random_features(kind), files[kind])
    return files


@pytest.fixture(scope="module")
def oracles(weights):
    """The lpips package's networks on the same files in float64, by kind; they are slow to build."""
    return {kind: oracle(kind, weights[kind]).double() for kind in MODELS}


@pytest.fixture
def offline(monkeypatch, tmp_path):
    """An empty torch cache and no way out."""
    def no_route(*_, **__):
        raise URLError("no route to host")

    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    monkeypatch.setattr(perceptual, "urlopen", no_route)
    monkeypatch.setattr(torch.hub, "download_url_to_file", no_route)
    return tmp_path / "hub" / "checkpoints"


def oracle(kind, path):
    """The lpips package's own network on the weights of a file."""
    import lpips

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torchvision's, on arguments that lpips still uses
        net = lpips.LPIPS(net=kind.removeprefix("lpips_"), pnet_rand=True, verbose=False)
    state = torch.load(path, weights_only=True)
    for number in range(1, net.net.N_slices + 1):
        part = getattr(net.net, f"slice{number}")
        part.load_state_dict({name: state[name] for name in part.state_dict()})
    return net


def images(count, side, seed, dtype=torch.float32):
    return torch.rand(count, side, side, generator=torch.Generator().manual_seed(seed), dtype=dtype)


def colours(image):
    return image[:, None].expand(-1, 3, -1, -1)


# --- values ---------------------------------------------------------------------------------------------------------

@each_kind
@pytest.mark.parametrize("input_range, odd", [("correct", 0), ("correct", 14), ("released", 1)])
def test_grey_images_score_as_their_colour_copies_do_in_the_lpips_package(kind, input_range, odd, weights, oracles):
    side = SMALLEST_PX[kind] + odd
    a, b = images(2, side, 1, torch.float64).requires_grad_(), images(2, side, 2, torch.float64)
    ours = perceptual.load(kind, weights[kind], input_range).double()(a, b)
    theirs = oracles[kind](colours(a), colours(b), normalize=input_range == "correct").flatten()
    torch.testing.assert_close(ours, theirs, rtol=1e-6, atol=0)
    gradients = [torch.autograd.grad(value.sum(), a)[0] for value in (ours, theirs)]
    assert (gradients[0] - gradients[1]).norm() < 1e-5 * gradients[1].norm()


def test_published_value_of_the_pretrained_squeeze_backbone():
    path = os.environ.get("FRACTAL_EXP_LPIPS_SQUEEZE")
    if not path:
        pytest.skip("FRACTAL_EXP_LPIPS_SQUEEZE does not name a file with SqueezeNet 1.1's pretrained features")
    torch.manual_seed(123)
    a, b = torch.rand(10, 3, 100, 100) * 2 - 1, torch.rand(10, 3, 100, 100) * 2 - 1
    reference = oracle("lpips_squeeze", path)
    with torch.no_grad():
        assert float(reference(a, b).mean()) == pytest.approx(0.1008, abs=5e-5)
        grey = (images(4, 100, 1), images(4, 100, 2))
        theirs = reference(*map(colours, grey), normalize=True).flatten()
        torch.testing.assert_close(perceptual.load("lpips_squeeze", path)(*grey), theirs, rtol=1e-5, atol=1e-6)


def test_batches_of_any_shape(weights):
    distance = perceptual.load("lpips_squeeze", weights["lpips_squeeze"])
    a, b = images(4, 24, 1), images(4, 24, 2)
    loop = torch.stack([distance(x, y) for x, y in zip(a, b, strict=True)])
    torch.testing.assert_close(distance(a, b), loop)
    torch.testing.assert_close(distance(a.view(2, 2, 24, 24), b.view(2, 2, 24, 24)), loop.view(2, 2))
    assert loop[0].shape == ()


def test_dead_features_leave_the_gradient_finite(weights, tmp_path):
    state = random_features("lpips_alex")
    state["8.bias"] -= 1e3  # no unit of the fourth layer ever fires
    torch.save(state, tmp_path / "dead.pth")
    distance, a, b = perceptual.load("lpips_alex", tmp_path / "dead.pth"), images(1, 40, 1), images(1, 40, 2)
    a.requires_grad_()
    assert float(distance.features(a)[3].detach().abs().max()) == 0
    (gradient,) = torch.autograd.grad(distance(a, b).sum(), a)
    assert torch.isfinite(gradient).all() and gradient.abs().max() > 0


@each_kind
def test_too_small_an_image_is_refused_and_the_smallest_is_not(kind, weights):
    distance, side = perceptual.load(kind, weights[kind]), SMALLEST_PX[kind]
    distance(images(1, side, 1), images(1, side, 2))
    with pytest.raises(InputError, match=f"{kind} needs images of at least {side} px"):
        distance.features(images(1, side - 1, 1))
    with pytest.raises(RuntimeError):  # the limit is the network's own
        distance.layers(images(1, side - 1, 1)[None])


# --- the module -----------------------------------------------------------------------------------------------------


def test_the_term_compares_with_features_computed_once(weights):
    a, target = images(3, 24, 1), images(1, 24, 2)[0]
    term = PerceptualTerm("lpips_squeeze", str(weights["lpips_squeeze"])).prepare(target)
    expected = perceptual.load("lpips_squeeze", weights["lpips_squeeze"])(a, target)
    torch.testing.assert_close(term(Rendering(a, *[torch.zeros(3, 1, 2)] * 3)), expected)
    assert term.name == "lpips_squeeze"
    assert not any(feature.requires_grad for feature in term.target_features)


# --- weight files ---------------------------------------------------------------------------------------------------


def test_a_download_goes_into_the_cache_and_is_checked(offline, weights, monkeypatch):
    asked = []

    def download(url, path, hash_prefix, progress):
        asked.append((url, hash_prefix))
        shutil.copy(weights["lpips_squeeze"], path)

    monkeypatch.setattr(perceptual, "urlopen", lambda *_, **__: open(os.devnull))
    monkeypatch.setattr(torch.hub, "download_url_to_file", download)
    for _ in range(2):
        perceptual.load("lpips_squeeze")
    assert asked == [("https://download.pytorch.org/models/squeezenet1_1-b8a52dc0.pth", "b8a52dc0")]


def test_without_any_weights_the_error_names_file_option_and_way_out(offline):
    with pytest.raises(WeightsUnavailable) as caught:
        perceptual.load("lpips_alex")
    message = str(caught.value)
    for part in (str(offline / "alexnet-owt-7be5be79.pth"), "weights=PATH", "perceptual=none", "no route to host"):
        assert part in message
    assert "\n" not in message and isinstance(caught.value, InputError)


class Surprise:
    def __reduce__(self):
        return Path.touch, (Path("unpickled"),)


def test_nothing_in_a_weight_file_is_executed(folder):
    torch.save({"0.weight": Surprise()}, "code.pth")
    with pytest.raises(InputError, match="cannot be read"):
        perceptual.load("lpips_squeeze", "code.pth")
    assert not Path("unpickled").exists()


def changed(**changes):
    """Random SqueezeNet features with some tensors replaced, added or (None) left out."""
    state = random_features("lpips_squeeze") | {name.replace("_", "."): value for name, value in changes.items()}
    return {name: value for name, value in state.items() if value is not None}


@pytest.mark.parametrize("content, message", [
    ([1, 2], "must hold a state dict .*, got list"),
    ({"epoch": 3}, "must hold a state dict"),
    (changed(**{"0_weight": torch.zeros(64, 1, 3, 3)}), "0.weight: 64×1×3×3, expected 64×3×"),
    (changed(**{"0_bias": None}),
     r"odd.pth \(read as the features of squeezenet1_1\) .* network: 0.bias: absent, expected 64"),
    (changed(**{"99_bias": torch.zeros(1)}), "99.bias: 1, expected absent"),
    (changed(**{"0_bias": torch.full((64,), torch.nan)}), "NaN or infinite values in 0.bias"),
])
def test_weights_of_another_network_are_refused(content, message, tmp_path):
    torch.save(content, tmp_path / "odd.pth")
    with pytest.raises(InputError, match=message):
        perceptual.load("lpips_squeeze", tmp_path / "odd.pth")


@pytest.mark.parametrize("arguments, message", [
    (("lpips_resnet",), "no perceptual distance 'lpips_resnet'; choose one of lpips_alex, lpips_squeeze, lpips_vgg"),
    (("none",), "leave the perceptual term out"),
    (("lpips_alex", None, "wide"), "input_range must be one of correct, released"),
])
def test_unknown_choices_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        perceptual.load(*arguments)
