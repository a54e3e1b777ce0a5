"""Perceptual distances of grey images by name: LPIPS on three backbones, and `fractal`, whose network is this project's
own and comes with it, behind one frozen module."""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from http.client import HTTPException
from pathlib import Path
from urllib.request import Request, urlopen

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable
from torch.nn.functional import fold

from ..errors import InputError
from ..runtime.checks import check_choice, check_unit
from ..runtime.extras import need
from ..runtime.weights import Weights
from . import fractal_features
from .feature_distance import unit_distance

INPUT_RANGES = {"correct": (2.0, -1.0), "released": (1.0, 0.0)}  # gain and shift from [0,1] to the network's input
CHANNEL_SHIFT = (-0.030, -0.088, -0.188)  # LPIPS's ScalingLayer: (input - shift) / scale, per colour
CHANNEL_SCALE = (0.458, 0.448, 0.450)
CONNECT_SECONDS = 10
RANGE_SLACK = 1e-4  # by which rounding may take an image out of [0,1]


class WeightsUnavailable(InputError):
    """No weight file was named, none is in torch's cache, and none could be downloaded.

    A metric catches this one, leaves its value absent and gives the message as the reason; anything else that `load`
    raises is a mistake in what was asked for.
    """


class PerceptualDistance(nn.Module):
    """d(a, b) = sum over layers l of mean over pixels of sum over channels c of w_lc (a_lc - b_lc)², where a_l and b_l
    are the features of layer l, scaled to unit length at every pixel (Zhang et al. 2018, equation 1).

    layers run on (B,1,H,W); features are read after the layers counted in `taps`, each with one row (C,) of
    `channel_weights`. `name` is what the distance is called in every table and tag. Frozen: no weight takes a
    gradient, images do. Images are (…,H,W) in [0,1], each side at least `smallest_px`.
    """

    def __init__(self, name: str, layers: nn.Sequential, taps: Sequence[int], channel_weights: Sequence[Tensor],
                 smallest_px: int):
        super().__init__()
        self.name, self.smallest_px, self.taps = name, smallest_px, tuple(taps)
        self.layers = layers
        self.channel_weights = nn.ParameterList(channel_weights)
        self.eval().requires_grad_(False)

    def features(self, image: Tensor) -> list[Tensor]:
        """Features (…,C,h,w) of every tapped layer, not scaled yet, for images (…,H,W) in [0,1].

        Raises `InputError` on an image that is too small for the network.
        """
        height, width = image.shape[-2:]
        if min(height, width) < self.smallest_px:
            raise InputError(f"{self.name} needs images of at least {self.smallest_px} px a side, got {height} by "
                             f"{width}; raise the resolution or leave the perceptual term out (perceptual=none)")
        batch, x, found = image.shape[:-2], image.reshape(-1, 1, height, width), []
        for count, layer in enumerate(self.layers, 1):
            x = layer(x)
            if count in self.taps:
                found.append(x.reshape(*batch, *x.shape[1:]))
        return found

    def compare(self, features: Sequence[Tensor], target_features: Sequence[Tensor]) -> Tensor:
        """Distances (…,) between two lists that `features` gave; their batches broadcast."""
        return unit_distance(features, target_features, list(self.channel_weights))

    def forward(self, image: Tensor, target: Tensor) -> Tensor:
        """Distances (…,) between images (…,H,W) in [0,1]."""
        return self.compare(self.features(image), self.features(target))


def load(kind: str, weights: str | Path | None = None, input_range: str = "correct") -> PerceptualDistance:
    """The perceptual distance called `kind`, on the CPU, ready for grey images in [0,1].

    kind: one of `kinds()`. weights: for LPIPS a torchvision checkpoint or a bare `features` state dict of the backbone
    (.pth, or .safetensors); without it torch's cache is looked up ($TORCH_HOME/hub/checkpoints), then torchvision's
    download tried. For "fractal" a file of its own format; without it the one in this package. input_range: of LPIPS,
    "correct" maps [0,1] to the [-1,1] that it was trained with, "released" feeds [0,1] as it is, as the paper's program
    does; "fractal" is fed with [0,1] in any case. Raises `WeightsUnavailable` if there are no weights to be had, and
    `InputError` on an unknown kind or range and on a file that is missing, unreadable or of another network.
    """
    if kind not in LOADERS:
        raise InputError(f"there is no perceptual distance {kind!r}; choose one of {', '.join(kinds())}, or leave the "
                         "perceptual term out (perceptual=none)")
    check_choice("input_range", input_range, INPUT_RANGES)
    return LOADERS[kind](weights, input_range)


def kinds() -> tuple[str, ...]:
    """The names that `load` knows."""
    return tuple(LOADERS)


@dataclass(frozen=True)
class Backbone:
    """A torchvision classifier whose `features`, read after the layers counted in `taps`, LPIPS compares.

    heads: the file of LPIPS's channel weights, version 0.1; smallest_px: the smallest side that passes all pools.
    """

    kind: str
    model: str
    taps: tuple[int, ...]
    heads: str
    smallest_px: int

    def load(self, weights: str | Path | None, input_range: str) -> PerceptualDistance:
        """LPIPS version 0.1 on this backbone, folded for grey images."""
        layers = self.layers(_cached_checkpoint(self) if weights is None else Path(weights).expanduser().absolute())
        layers[0] = _GreyStem(layers[0], *INPUT_RANGES[input_range])
        layers.to(memory_format=torch.channels_last)  # the forward pass costs a CPU up to 2.5 times less
        return PerceptualDistance(self.kind, layers, self.taps, _heads(self.heads), self.smallest_px)

    def layers(self, path: Path) -> nn.Sequential:
        """The backbone's layers up to the last tap, with the weights of a file: a whole checkpoint or its features."""
        need("torchvision")
        from torchvision.models import get_model

        with torch.device("meta"):  # no memory, and no draw from the global random generator
            features = get_model(self.model, weights=None).features
        state, prefix = _read(path), "features."
        inner = {name.removeprefix(prefix): value for name, value in state.items() if name.startswith(prefix)} or state
        singles = {name: value.float() for name, value in inner.items()}
        Weights(singles, {}, {}, f"{path} (read as the features of {self.model})", "").fill(features)
        return features[:self.taps[-1]]


class _GreyStem(nn.Module):
    """A colour convolution applied to a grey image repeated over its channels, after LPIPS's scaling, in one step.

    The scaled colours are gain_c x + shift_c, zero-padded after scaling, so the sum over colours is a convolution of x
    plus one of the constant 1, exact at the border too. The constant stays a channel of its own: cheaper than a third
    colour, and (unlike a map cached per size) it costs no state.
    """

    def __init__(self, conv: nn.Conv2d, gain: float, shift: float):
        super().__init__()
        weight = conv.weight.double()
        channel_shift, scale = (weight.new_tensor(v).view(1, 3, 1, 1) for v in (CHANNEL_SHIFT, CHANNEL_SCALE))
        folded = [(weight * gain / scale).sum(1), (weight * (shift - channel_shift) / scale).sum(1)]
        self.conv = nn.Conv2d(2, conv.out_channels, conv.kernel_size, conv.stride, conv.padding, device="meta")
        self.conv.weight = nn.Parameter(torch.stack(folded, 1).to(conv.weight.dtype))
        self.conv.bias = conv.bias

    def forward(self, x: Tensor) -> Tensor:
        return _GreyConvolution.apply(x, self.conv)


class _GreyConvolution(torch.autograd.Function):
    """The convolution of `_GreyStem`, (B,1,H,W) -> (B,C,h,w), differentiable in the image alone.

    A product of matrices and a sum of shifted images give the gradient, in a fifth of the time that a CPU takes for
    PyTorch's own by so few channels.
    """

    @staticmethod
    def forward(ctx, x: Tensor, conv: nn.Conv2d) -> Tensor:
        ctx.conv, ctx.size = conv, x.shape[-2:]
        return conv(torch.cat([x, torch.ones_like(x)], 1))

    @staticmethod
    @once_differentiable
    def backward(ctx, cotangent: Tensor) -> tuple[Tensor, None]:
        conv = ctx.conv
        parts = conv.weight[:, 0].flatten(1).mT @ cotangent.flatten(2)
        return fold(parts, ctx.size, conv.kernel_size, stride=conv.stride, padding=conv.padding), None


def _heads(name: str) -> list[Tensor]:
    """The channel weights (C,) of every layer, which travel inside the lpips package."""
    need("lpips")
    package = Path(importlib.util.find_spec("lpips").origin).parent  # importing it would cost a second
    state = torch.load(package / "weights" / "v0.1" / f"{name}.pth", map_location="cpu", weights_only=True)
    return [nn.Parameter(state[f"lin{layer}.model.1.weight"].flatten()) for layer in range(len(state))]


def _cached_checkpoint(backbone: Backbone) -> Path:
    """torchvision's file of ImageNet weights in torch's cache, downloaded if it is not there."""
    need("torchvision")
    from torchvision.models import get_model_weights

    url = get_model_weights(backbone.model)["IMAGENET1K_V1"].url
    path = Path(torch.hub.get_dir()).absolute() / "checkpoints" / Path(url).name
    if path.is_file():
        return path
    try:
        # torch's own download waits for a dead network without a limit
        urlopen(Request(url, method="HEAD"), timeout=CONNECT_SECONDS).close()
        path.parent.mkdir(parents=True, exist_ok=True)
        checksum = re.search(r"-([0-9a-f]{8,})\.", path.name)
        torch.hub.download_url_to_file(url, str(path), hash_prefix=checksum and checksum[1],
                                       progress=sys.stderr.isatty())
    except (OSError, RuntimeError, HTTPException) as error:
        raise WeightsUnavailable(
            f"{backbone.kind} needs torchvision's {backbone.model} weights: no file was given, {path} is not there, "
            f"and the download of {url} failed ({error}); fetch that file elsewhere and name it with "
            "weights=PATH (on the command line: perceptual_weights=PATH), or leave the perceptual term out "
            "(perceptual=none)") from error
    return path


def _read(path: Path) -> dict[str, Tensor]:
    """A state dict from a .pth or .safetensors file; nothing is unpickled."""
    if not path.is_file():
        raise InputError(f"there is no weight file {path}; name a torchvision checkpoint or a features state dict")
    try:
        if path.suffix == ".safetensors":
            from safetensors.torch import load_file

            return load_file(path)
        state = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # the two readers raise a dozen kinds on a foreign or truncated file
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{path} cannot be read as a state dict: {reason}") from error
    if not isinstance(state, dict) or not all(isinstance(value, Tensor) for value in state.values()):
        raise InputError(f"{path} must hold a state dict (names and tensors), got {type(state).__name__}")
    return state


_BACKBONES = (
    Backbone("lpips_alex", "alexnet", (2, 5, 8, 10, 12), "alex", 31),
    Backbone("lpips_squeeze", "squeezenet1_1", (2, 5, 8, 10, 11, 12, 13), "squeeze", 17),
    Backbone("lpips_vgg", "vgg16", (4, 9, 16, 23, 30), "vgg", 16),
)


def _load_fractal(weights: str | Path | None, input_range: str) -> PerceptualDistance:
    """LPIPS's construction on the network of `fractal_features`, which takes [0,1] as it is, as `released` feeds it."""
    found = fractal_features.load(weights)
    found.layers.to(memory_format=torch.channels_last)
    return PerceptualDistance("fractal", found.layers, fractal_features.TAPS, list(found.channel_weights),
                              fractal_features.SMALLEST_PX)


# name -> (weights, input_range) -> distance
LOADERS: dict[str, Callable[[str | Path | None, str], PerceptualDistance]] = {
    **{backbone.kind: backbone.load for backbone in _BACKBONES}, "fractal": _load_fractal,
}


@cache
def _loaded(kind: str, device: torch.device, dtype: torch.dtype) -> PerceptualDistance:
    return load(kind).to(device, dtype)


def perceptual_distance(a: Tensor, b: Tensor, kind: str = "fractal") -> Tensor:
    """The perceptual distance `kind` between images a and b, (…,H,W) in [0,1], whose batches broadcast: (…,).

    Differentiable in both. The network is loaded at the first call and kept, for each device and dtype. In a loop
    against one target, `load(kind)` and its `features` save half of the work. Raises `InputError` on images that
    differ in size, device or dtype, whose batches are empty or do not broadcast, that are too small for the network,
    are not finite or leave [0,1], and what `load` raises.
    """
    for name, image in (("a", a), ("b", b)):
        if not isinstance(image, Tensor) or image.ndim < 2 or not image.is_floating_point():
            got = f"{image.dtype} {tuple(image.shape)}" if isinstance(image, Tensor) else type(image).__name__
            raise InputError(f"{name} must be a tensor of floats (…,H,W), got {got}")
        if image.numel() == 0:
            raise InputError(f"{name} must hold at least one image of at least one pixel, got {tuple(image.shape)}; "
                             "leave empty batches out")
        check_unit(name, image.detach(), RANGE_SLACK)
    if a.shape[-2:] != b.shape[-2:] or a.device != b.device or a.dtype != b.dtype:
        raise InputError(f"a and b must agree in size, device and dtype, got {tuple(a.shape)} {a.dtype} on {a.device} "
                         f"and {tuple(b.shape)} {b.dtype} on {b.device}")
    try:
        torch.broadcast_shapes(a.shape[:-2], b.shape[:-2])
    except RuntimeError:
        raise InputError(f"the batches of a and b must broadcast, got {tuple(a.shape)} and {tuple(b.shape)}; give them "
                         "as many images, or one of them a single image") from None
    return _loaded(kind, a.device, a.dtype)(a, b)
