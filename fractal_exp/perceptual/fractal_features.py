"""The network behind the perceptual distance `fractal`: its layers, its file format and the file in this package."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from ..errors import InputError
from ..runtime.files import check_file, parse_json, write_atomically

FORMAT, VERSION = "fractal-exp/perceptual", 1
CHANNELS = (8, 24, 48, 64, 96, 128, 128)  # of the seven levels, at a half, a quarter … a 64th of the image's side; the
STRIDES = (2, 2, 2, 2, 2, 2, 1)           # last is as coarse as the one before and sees 257 pixels a side
KERNELS = (5, 3, 3, 3, 3, 3, 3)
TAPS = (2, 4, 6, 8, 10, 12, 14)           # features are read after each level's ReLU
SMALLEST_PX = 32                          # one whole pixel of the fifth level; the padding fills up the last two

LARGEST_FILE = 2**28                      # bytes of a weight file; this network needs less than a megabyte
SHIPPED = "fractal_features.safetensors"  # in the folder data/ of fractal_exp
SHIPPED_SHA256 = "3119823362fcd7c843a7db213329c5900cddd19a8a2c25261adc91b3c8b4e856"


@dataclass(frozen=True)
class FractalFeatures:
    """What a weight file holds: `layers` from grey images (B,1,H,W), one row (C,) of `channel_weights`, at least 0,
    for each of `TAPS`, and the `recipe` of its training as plain data."""

    layers: nn.Sequential
    channel_weights: tuple[Tensor, ...]
    recipe: Mapping[str, Any]


def network() -> nn.Sequential:
    """The seven levels, each a convolution and a ReLU: (B,1,H,W) -> (B,128,H/64,W/64).

    On the meta device, where weights take no memory, nor draws of the global random generator: `to_empty` makes room
    for values, `load_state_dict(assign=True)` takes those of a file.
    """
    layers: list[nn.Module] = []
    for before, after, kernel, stride in zip((1, *CHANNELS), CHANNELS, KERNELS, STRIDES, strict=False):
        layers += [nn.Conv2d(before, after, kernel, stride, padding=kernel // 2, device="meta"), nn.ReLU()]
    return nn.Sequential(*layers)


def save(path: str | Path, layers: nn.Sequential, channel_weights: Sequence[Tensor], recipe: Mapping[str, Any]) -> Path:
    """Write a weight file (safetensors, float16) and return its absolute path. `recipe`: plain data, kept as JSON."""
    from safetensors.torch import save as to_bytes

    tensors = {f"layers.{name}": value for name, value in layers.state_dict().items()}
    tensors |= {f"channel_weights.{level}": weight for level, weight in enumerate(channel_weights)}
    tensors = {name: value.detach().cpu().half().contiguous() for name, value in tensors.items()}
    notes = {"format": FORMAT, "version": str(VERSION), "recipe": json.dumps(dict(recipe))}
    path = Path(path).absolute()
    write_atomically(path, to_bytes(tensors, metadata=notes))
    return path


def load(path: str | Path | None = None) -> FractalFeatures:
    """The network of a weight file, float32 on the CPU; without a path that of this package, checked by its hash.

    Raises `InputError` on a file that is missing, damaged, of another format, version or shape, or not finite.
    """
    if path is None:
        return _parse(_shipped(), f"this package's {SHIPPED}")
    path = check_file(Path(path).expanduser(), "the weight file", LARGEST_FILE)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read the weight file {path}: {error.strerror}; name one that fractal-perceptual "
                         "wrote, or none for the one in this package") from error
    return _parse(data, str(path))


def _shipped() -> bytes:
    """The file in this package, whole and as it was published."""
    file = resources.files("fractal_exp.data") / SHIPPED
    remedy = "reinstall fractal-exp, or name a file that benchmarks.perceptual_training wrote with perceptual_weights=PATH"
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(f"this installation lacks its weight file {file}; {remedy}") from error
    if (digest := hashlib.sha256(data).hexdigest()) != SHIPPED_SHA256:
        raise InputError(f"the weight file {file} is damaged: its SHA-256 is {digest}, expected {SHIPPED_SHA256}; "
                         f"{remedy}")
    return data


def _parse(data: bytes, name: str) -> FractalFeatures:
    from safetensors import SafetensorError
    from safetensors.torch import load as from_bytes

    try:
        tensors = from_bytes(data)
    except (SafetensorError, ValueError) as error:
        raise InputError(f"{name} cannot be read as safetensors: {error}; name a file that benchmarks.perceptual_training wrote "
                         "(perceptual_weights=PATH)") from error
    notes = _notes(data, name)
    if notes.get("format") != FORMAT or notes.get("version") != str(VERSION):
        raise InputError(f"{name} must be of the format {FORMAT!r} version {VERSION}, got {notes.get('format')!r} "
                         f"version {notes.get('version')!r}; train one with benchmarks.perceptual_training, or leave "
                         "perceptual_weights out for the one in this package")
    layers = network()
    expected = {f"layers.{key}": tuple(value.shape) for key, value in layers.state_dict().items()}
    expected |= {f"channel_weights.{level}": (count,) for level, count in enumerate(CHANNELS)}
    _check(tensors, expected, name)
    tensors = {key: value.float() for key, value in tensors.items()}
    layers.load_state_dict({key.removeprefix("layers."): value for key, value in tensors.items()
                            if key.startswith("layers.")}, assign=True)
    weights = tuple(tensors[f"channel_weights.{level}"] for level in range(len(CHANNELS)))
    return FractalFeatures(layers, weights, _recipe(notes, name))


def _notes(data: bytes, name: str) -> dict[str, str]:
    """The metadata of whole safetensors bytes: a header of as many bytes as the first eight say, in JSON."""
    header = data[8:8 + int.from_bytes(data[:8], "little")]
    return parse_json(header, f"{name} is damaged: its header").get("__metadata__") or {}


def _recipe(notes: Mapping[str, str], name: str) -> dict[str, Any]:
    try:
        recipe = parse_json(notes.get("recipe", "{}").encode(), "its recipe")
    except InputError as error:
        raise InputError(f"{name} is damaged: {error}; copy it anew, or train one with benchmarks.perceptual_training") from error
    if not isinstance(recipe, dict):
        raise InputError(f"{name} is damaged: its recipe must be a JSON object, got {type(recipe).__name__}; copy it "
                         "anew, or train one with benchmarks.perceptual_training")
    return recipe


def _check(tensors: Mapping[str, Tensor], expected: Mapping[str, tuple[int, ...]], name: str) -> None:
    if odd := sorted(set(tensors) ^ set(expected)):
        raise InputError(f"{name} does not hold this network: {odd[0]} is "
                         f"{'missing' if odd[0] in expected else 'unknown'} (expected {len(expected)} tensors, got "
                         f"{len(tensors)})")
    for key, value in tensors.items():
        if tuple(value.shape) != expected[key]:
            raise InputError(f"{name} does not hold this network: {key} has shape {tuple(value.shape)}, expected "
                             f"{expected[key]}")
        if not bool(torch.isfinite(value).all()):
            raise InputError(f"{name}: {key} has NaN or infinite values; train it anew with fractal-perceptual")
        if key.startswith("channel_weights.") and bool((value < 0).any()):
            raise InputError(f"{name}: {key} must not be negative, got {float(value.min()):.4g}; a distance has "
                             "weights of at least 0")
