"""Files of trained networks: what is read is what was written, and whatever is wrong with a file is said."""


import pytest
import torch
from safetensors.torch import save as to_bytes
from torch import nn

from fractal_exp import InputError
from fractal_exp.runtime import weights
from fractal_exp.runtime.tensors import digest


@pytest.fixture
def file(tmp_path):
    network = nn.Linear(3, 2)
    return weights.save(tmp_path / "net.safetensors", "net", network.state_dict(), {"side": 8}, {"held_out": .5})


def test_what_is_read_is_what_was_written(tmp_path):
    network = nn.Module()
    network.register_buffer("index", torch.tensor([3, 70_000]))
    network.weight = nn.Parameter(torch.tensor([1.0, -0.1]))
    path = weights.save(tmp_path / "net.safetensors", "net", network.state_dict(), {"side": 8}, {"held_out": .5})
    found = weights.load(path, "net")
    again = weights.save(tmp_path / "again", "net", network.state_dict(), {"side": 9}, {"held_out": .5})
    assert weights.load(path, "net").digest == found.digest != weights.load(again, "net").digest
    assert found.recipe == {"side": 8} and found.scores == {"held_out": .5} and found.source == str(path)
    assert found.tensors["index"].tolist() == [3, 70_000], "whole numbers stay whole"
    assert torch.allclose(found.tensors["weight"], network.weight, rtol=1e-3)
    assert found.tensors["weight"].dtype == torch.float32


def test_every_changed_byte_is_seen(file):
    data = file.read_bytes()
    for place in range(8, len(data), 7):
        file.write_bytes(data[:place] + bytes([data[place] ^ 4]) + data[place + 1:])
        with pytest.raises(InputError, match="net.safetensors"):
            weights.load(file, "net")
    file.write_bytes(data[:-1] + b"x")
    with pytest.raises(InputError, match="is damaged: its content does not give its checksum"):
        weights.load(file, "net")
    file.write_bytes(data)
    weights.load(file, "net")


def test_a_file_that_is_none(file, tmp_path):
    with pytest.raises(InputError, match="cannot read the weights .*absent"):
        weights.load(tmp_path / "absent", "net")
    with pytest.raises(InputError, match="net has no weights: none are given, and the package has none"):
        weights.load(None, "net")
    with pytest.raises(InputError, match="it is a folder"):
        weights.load(tmp_path, "net")
    for data in (file.read_bytes()[:-3], b"", b"no weights"):
        file.write_bytes(data)
        with pytest.raises(InputError, match="is damaged, or no safetensors file"):
            weights.load(file, "net")
    file.write_bytes(to_bytes({"a": torch.zeros(2)}))
    with pytest.raises(InputError, match="must be of the format 'fractal-exp/weights/1', got None"):
        weights.load(file, "net")


def test_a_file_of_another_network(file):
    with pytest.raises(InputError, match="holds the network 'net', expected 'other'"):
        weights.load(file, "other")
    found = weights.load(file, "net")
    with pytest.raises(InputError, match="weight: 2×3, expected 2×4"):
        found.fill(nn.Linear(4, 2))
    with pytest.raises(InputError, match="bias: 2, expected absent"):
        found.fill(nn.Linear(3, 2, bias=False))
    with pytest.raises(InputError, match="0.bias: absent, expected 2"):
        found.fill(nn.Sequential(nn.Linear(3, 2)))


@pytest.mark.parametrize("notes", ["[1]", "{}", '{"network": "net", "recipe": [1], "scores": {}}'])
def test_notes_of_another_form_are_refused(tmp_path, notes):
    tensors = {"a": torch.zeros(2)}
    metadata = {"format": weights.FORMAT, "trained": notes, "sha256": digest(tensors, notes)}
    (tmp_path / "odd").write_bytes(to_bytes(tensors, metadata=metadata))
    with pytest.raises(InputError, match="odd is damaged: its notes must name"):
        weights.load(tmp_path / "odd", "net")
