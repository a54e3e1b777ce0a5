"""The network behind the perceptual distance `fractal`: its layers, its file format and the file in this package."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from ..errors import InputError
from ..runtime import weights
from ..runtime.files import parse_json, read_file, write_atomically
from ..runtime.tensors import parsed

FORMAT, VERSION = "fractal-exp/perceptual", "1"
CHANNELS = (8, 24, 48, 64, 96, 128, 128)  # of the seven levels, at a half, a quarter … a 64th of the image's side; the
STRIDES = (2, 2, 2, 2, 2, 2, 1)           # last is as coarse as the one before and sees 257 pixels a side
KERNELS = (5, 3, 3, 3, 3, 3, 3)
TAPS = (2, 4, 6, 8, 10, 12, 14)           # features are read after each level's ReLU
SMALLEST_PX = 32                          # one whole pixel of the fifth level; the padding fills up the last two

LARGEST_FILE = 2**28                      # bytes of a weight file; this network needs less than a megabyte
SHIPPED = "fractal_features.safetensors"  # in the folder data/ of fractal_exp
SHIPPED_SHA256 = "3119823362fcd7c843a7db213329c5900cddd19a8a2c25261adc91b3c8b4e856"


class FractalFeatures(nn.Module):
    """What a weight file holds: `layers` from grey images (B,1,H,W), one row (C,) of `channel_weights`, at least 0,
    for each of `TAPS`, and the `recipe` of its training as plain data."""

    def __init__(self, layers: nn.Sequential, channel_weights: Iterable[Tensor], recipe: Mapping[str, Any]):
        super().__init__()
        self.layers, self.recipe = layers, recipe
        self.channel_weights = nn.ParameterList(channel_weights)


def network() -> nn.Sequential:
    """The seven levels, each a convolution and a ReLU: (B,1,H,W) -> (B,128,H/64,W/64).

    On the meta device, where weights take no memory, nor draws of the global random generator: `to_empty` makes room
    for values, `load_state_dict(assign=True)` takes those of a file.
    """
    layers: list[nn.Module] = []
    for before, after, kernel, stride in zip((1, *CHANNELS), CHANNELS, KERNELS, STRIDES, strict=False):
        layers += [nn.Conv2d(before, after, kernel, stride, padding=kernel // 2, device="meta"), nn.ReLU()]
    return nn.Sequential(*layers)


def save(path: str | Path, layers: nn.Sequential, channel_weights: Iterable[Tensor], recipe: Mapping[str, Any]) -> Path:
    """Write a weight file (safetensors, float16) and return its absolute path. `recipe`: plain data, kept as JSON."""
    from safetensors.torch import save as to_bytes

    tensors = {name: value.detach().cpu().half().contiguous()
               for name, value in FractalFeatures(layers, channel_weights, recipe).state_dict().items()}
    notes = {"format": FORMAT, "version": VERSION, "recipe": json.dumps(dict(recipe))}
    path = Path(path).absolute()
    write_atomically(path, to_bytes(tensors, metadata=notes))
    return path


def load(path: str | Path | None = None) -> FractalFeatures:
    """The network of a weight file, float32 on the CPU; without a path that of this package, checked by its hash.

    Raises `InputError` on a file that is missing, damaged, of another format, version or shape, or not finite.
    """
    if path is None:
        data, name = _shipped(), f"this package's {SHIPPED}"
    else:
        data, name = read_file(Path(path).expanduser(), "the weight file", LARGEST_FILE), str(path)
    tensors, notes = parsed(data, name)
    if (got := (notes.get("format"), notes.get("version"))) != (FORMAT, VERSION):
        raise InputError(f"{name} must be of the format {FORMAT!r} version {VERSION}, got {got[0]!r} version "
                         f"{got[1]!r}; leave perceptual_weights out for the file in this package")
    recipe = parse_json(notes.get("recipe", "{}").encode(), f"{name} is damaged: its recipe")
    if not isinstance(recipe, dict):
        raise InputError(f"{name} is damaged: its recipe must be a JSON object, got {type(recipe).__name__}; copy it "
                         "anew")
    found = FractalFeatures(network(), [torch.empty(count, device="meta") for count in CHANNELS], recipe)
    singles = {key: value.float() for key, value in tensors.items()}
    weights.Weights(singles, recipe, {}, name, "").fill(found)
    for key, value in singles.items():
        if key.startswith("channel_weights.") and bool((value < 0).any()):
            raise InputError(f"{name}: {key} must not be negative, got {float(value.min()):.4g}; a distance has "
                             "weights of at least 0")
    return found


def _shipped() -> bytes:
    """The file in this package, whole and as it was published."""
    file = resources.files("fractal_exp.data") / SHIPPED
    remedy = "reinstall fractal-exp, or name another file with perceptual_weights=PATH"
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(f"this installation lacks its weight file {file}; {remedy}") from error
    if (digest := hashlib.sha256(data).hexdigest()) != SHIPPED_SHA256:
        raise InputError(f"the weight file {file} is damaged: its SHA-256 is {digest}, expected {SHIPPED_SHA256}; "
                         f"{remedy}")
    return data
