"""Neural regression: its network and its codes by hand, and what it refuses."""

import numpy as np
import pytest
import torch
from networks_helpers import REGRESSION, saved
from rivals_helpers import TARGET

from fractal_exp import InputError
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.methods.neural_regression.method import NeuralRegression
from fractal_exp.methods.neural_regression.network import IDENTITY, RegressionNetwork
from fractal_exp.training.codes import table
from fractal_exp.training.drawing import draw
from fractal_exp.training.epochs import turned
from fractal_exp.training.neural_regression import RegressionTraining, sorted_rows


@pytest.fixture
def file(tmp_path):
    return str(saved(tmp_path / "net.safetensors", "neural_regression"))


def test_the_network_is_the_published_one():
    network = RegressionNetwork(128, 10, (32, 64, 128), 256, 0.01, linear=False)
    assert [type(layer).__name__ for layer in network.layers] == [
        *["Conv2d", "ReLU", "MaxPool2d"] * 3, "Flatten", "Linear", "ReLU", "Linear"]
    shapes = [tuple(value.shape) for name, value in network.named_parameters() if name.endswith("weight")]
    assert shapes == [(32, 1, 3, 3), (64, 32, 3, 3), (128, 64, 3, 3), (256, 128 * 16 * 16), (60, 256)]
    released = RegressionNetwork(128, 10, (32, 64, 128), 256, 0.01, linear=True)
    assert [type(layer).__name__ for layer in released.layers][-3:] == ["Flatten", "Linear", "Linear"]


def test_what_comes_out_are_deviations_from_the_identity():
    network = RegressionNetwork(16, 3, (2, 2), 4, 0.01, linear=False)
    images = torch.rand(2, 16, 16)
    found = network(images)
    assert found.shape == (2, 3, 6)
    with torch.no_grad():
        network.layers[-1].weight.zero_()
        network.layers[-1].bias.copy_(torch.arange(18.0))
    assert torch.allclose(network(images)[1].flatten(), torch.tensor(IDENTITY).repeat(3) + 0.01 * torch.arange(18.0))


def test_maps_are_sorted_by_their_largest_singular_value_and_repeated():
    code = np.array([[.2, 0, 0, .3, 1, 1], [0, -.9, .1, 0, 2, 2], [.5, 0, 0, -.5, 3, 3.0]])
    assert sorted_rows(code, 3)[:, 4].tolist() == [2, 3, 1]
    assert sorted_rows(code, 10)[:, 4].tolist() == [2] * 4 + [3] * 3 + [1] * 3


def test_a_turned_code_has_a_turned_picture():
    training = RegressionTraining(**REGRESSION)
    code, seen = training.code(0), set()
    for seed in range(40):
        again = turned(code, np.random.default_rng(seed))
        matrices = np.stack([code[:, :4], again[:, :4]]).reshape(2, -1, 2, 2)
        assert np.allclose(*np.linalg.svd(matrices, compute_uv=False))
        maps, p = table([code, again])
        pictures = draw(maps, p, np.array([5, 5]), np.array([200_000] * 2), 16, 4) > 0
        ways = [np.rot90(mirrored, k) for mirrored in (pictures[0], pictures[0].T) for k in range(4)]
        share = [float((way == pictures[1]).mean()) for way in ways]
        assert max(share) > .97, "the picture of the turned code is a turned picture"
        seen.add(int(np.argmax(share)))
    assert seen == set(range(8)), "all eight ways are drawn"


def test_the_fit_draws_the_code_that_the_network_gives(file):
    method = NeuralRegression(weights=file, side=16)
    seen = []
    found = method.reconstruct(TARGET, on_step=seen.append)
    assert isinstance(found, CodeReconstruction) and len(found.code) == 10 and found.evaluations == 0
    assert found.stopped == "one pass of the network done" and float(found.code.singular_values().max()) < .991
    (progress,) = seen
    assert progress.fraction == 1 and progress.preview.shape == (16, 16) and progress.code is found.code
    again = NeuralRegression(weights=file, side=16).reconstruct(TARGET)
    assert torch.equal(found.code.linear, again.code.linear)
    other = method.reconstruct(TARGET.flip(0))
    assert not torch.equal(found.code.linear, other.code.linear), "it looks at the image"


def test_a_target_below_the_networks_own_size_is_refused_before_the_weights_are_read():
    method = NeuralRegression(weights="absent", side=64)
    with pytest.raises(InputError, match="the network sees 64² pixels, and the target has 32²; raise resolution to 64"):
        method.check(TARGET)
    with pytest.raises(InputError, match="must be square"):
        method.check(torch.zeros(64, 32))
