"""Files of trained networks: tensors, and what they were trained on, in one safetensors file with a checksum."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from ..errors import InputError
from .files import parse_json, read_file, write_atomically
from .tensors import differences, packed, unpacked

FORMAT = "fractal-exp/weights/1"
LARGEST_FILE = 2**31  # bytes


@dataclass(frozen=True)
class Weights:
    """The tensors of a network by name, float32 on the CPU; `recipe`: what it was trained with, and `scores`: what came
    of it, both as plain data. source: where they are from, in words; digest: SHA-256 of all of it."""

    tensors: Mapping[str, Tensor]
    recipe: Mapping[str, Any]
    scores: Mapping[str, float]
    source: str
    digest: str

    def check(self, network: nn.Module) -> None:
        """Raise `InputError` unless the tensors have the names, shapes and types of this network's, which may be on
        torch's meta device, and all values are finite."""
        if odd := differences(self.tensors, network.state_dict()):
            raise InputError(f"{self.source} does not hold this network: {'; '.join(odd[:4])}")
        for name, value in self.tensors.items():
            if not bool(torch.isfinite(value).all()):
                raise InputError(f"{self.source} has NaN or infinite values in {name}")

    def fill(self, network: nn.Module) -> None:
        """Put the tensors into a network that `check` accepts."""
        self.check(network)
        network.load_state_dict(dict(self.tensors), assign=True)


def save(path: str | Path, network: str, tensors: Mapping[str, Tensor], recipe: Mapping[str, Any],
         scores: Mapping[str, float]) -> Path:
    """Write a file of the network of this name, its fractions as float16, and return its absolute path."""
    halves = {name: _as(torch.float16, value.detach().cpu()) for name, value in tensors.items()}
    told = json.dumps({"network": network, "recipe": dict(recipe), "scores": dict(scores)})
    path = Path(path).absolute()
    write_atomically(path, packed(halves, FORMAT, "trained", told))
    return path


def load(path: str | Path | None, network: str) -> Weights:
    """The weights in a file that `save` wrote for the network of this name; None: in that of the package.

    Raises `InputError` on a file that is missing, damaged, of another format or of another network.
    """
    if path is None:
        shipped = resources.files("fractal_exp.data") / f"{network}.safetensors"
        if not shipped.is_file():
            raise InputError(f"{network} has no weights: none are given, and the package has none")
        return _parse(shipped.read_bytes(), network, str(shipped))
    path = Path(path).expanduser().absolute()
    return _parse(read_file(path, "the weights", LARGEST_FILE), network, str(path))


def _parse(data: bytes, network: str, source: str) -> Weights:
    tensors, told, digest = unpacked(data, FORMAT, "trained", source)
    trained = parse_json(told.encode(), f"{source} is damaged: its notes")
    if not (isinstance(trained, dict) and isinstance(trained.get("network"), str)
            and all(isinstance(trained.get(name), dict) for name in ("recipe", "scores"))):
        raise InputError(f"{source} is damaged: its notes must name a network, a recipe and scores")
    if trained["network"] != network:
        raise InputError(f"{source} holds the network {trained['network']!r}, expected {network!r}")
    singles = {name: _as(torch.float32, value) for name, value in tensors.items()}
    return Weights(singles, trained["recipe"], trained["scores"], source, digest)


def _as(kind: torch.dtype, tensor: Tensor) -> Tensor:
    """Fractions of this kind; whole numbers as they are."""
    return tensor.to(kind) if tensor.is_floating_point() else tensor
