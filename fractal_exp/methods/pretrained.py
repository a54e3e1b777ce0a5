"""Methods whose network is trained beforehand: where its weights come from, and what they must have been made for."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

import torch
from pydantic import Field
from torch import Tensor, nn

from ..errors import InputError
from ..ifs.code import IFS
from ..rendering.still import render
from ..runtime import weights as files
from ..runtime.checkpoint import Checkpoint
from ..runtime.checks import check_seconds
from ..runtime.params import Params
from ..runtime.precision import full_precision
from .base import AnyTarget, CodeReconstruction, Method, OnStep, Progress, check_device, check_target, resized


class PretrainedParams(Params):
    """The parameters that every such method has."""

    weights: str | None = None
    """File of the network's weights, as `fractal-train task=pretrain` writes them; null: those in the package, if it
    has any."""


class Pretrained(Method):
    """A method that asks a trained network. Weights are read when they are first needed, and refused unless they were
    trained for what the parameters ask for.

    seconds: a limit, which a network never reaches. device: where it works. options: the parameters of `Params`.
    Raises `InputError` on values out of range.
    """

    name: ClassVar[str]  # of the network, in files and commands
    asked: ClassVar[Mapping[str, str]]  # settings that weights must have been trained with: name -> in words
    Params: ClassVar[type[PretrainedParams]]

    def __init__(self, *, seconds: float | None = None, device: str = "cpu", **options: Any):
        check_seconds(seconds)
        self.params = self.Params().updated(**options)
        self.seconds, self.device = seconds, check_device(device)
        self._loaded: tuple[nn.Module, files.Weights] | None = None

    @classmethod
    @abstractmethod
    def build(cls, recipe: Mapping[str, Any]) -> nn.Module:
        """The network that a recipe describes, with first weights from torch's global generator."""

    @classmethod
    def built(cls, recipe: Mapping[str, Any], seed: int = 0) -> nn.Module:
        """The network with first weights from this seed; torch's global generator stays as it is."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return cls.build(recipe)

    @abstractmethod
    def check_size(self, target: Tensor) -> None:
        """Raise `InputError` unless the network can take a checked image (R,R)."""

    def check(self, target: AnyTarget) -> None:
        self.check_size(check_target(target))
        self.loaded()

    def fingerprint(self) -> str:
        return self.loaded()[1].digest

    def loaded(self) -> tuple[nn.Module, files.Weights]:
        """The network with its weights, on the device, and what they were trained with.

        Raises `InputError` if there are none, or they are damaged or of another network, size or number of maps. The
        message names the command that trains them.
        """
        if self._loaded is None:
            try:
                found = files.load(self.params.weights, self.name)
                self._compare(found)
                network = self._described(found)
                found.fill(network)
            except InputError as error:
                raise InputError(f"{error}; {self.remedy()}") from error
            self._loaded = network.eval().to(self.device), found
        return self._loaded

    def command(self) -> str:
        """What trains this network, as far as it depends on the parameters."""
        shown = (f" method.{name}={str(value).lower()}" for name in self.asked
                 if (value := getattr(self.params, name)) != type(self.params).model_fields[name].default)
        return f"fractal-train task=pretrain method={self.name}{''.join(shown)}"

    def remedy(self) -> str:
        """What to do without good weights."""
        return (f"`{self.command()}` trains them, and `fractal-train method={self.name} weights.{self.name}=FILE` "
                "takes the file that it writes")

    def _described(self, found: files.Weights) -> nn.Module:
        try:
            with torch.device("meta"):  # a recipe may ask for any amount of memory: its shapes are compared first
                sketch = self.build(found.recipe)
            found.check(sketch)
            return self.built(found.recipe)
        except InputError:
            raise
        except Exception as error:  # whatever a stranger's recipe makes a constructor raise
            first = (str(error).splitlines() or [""])[0]
            raise InputError(f"the recipe in {found.source} describes no network of {self.name}: "
                             f"{type(error).__name__}: {first}") from error

    def _compare(self, found: files.Weights) -> None:
        for name, words in self.asked.items():
            wanted, trained = getattr(self.params, name), found.recipe.get(name)
            if wanted != trained:
                raise InputError(f"{found.source} was trained with {words} {trained}, and {wanted} is asked for "
                                 f"({name})")


class CodeReaderParams(PretrainedParams):
    """The parameters of a network that reads a code off an image."""

    side: Annotated[int, Field(ge=16, le=512, multiple_of=8)] = 64
    """Pixels a side of the image as the network sees it; weights know one size."""
    largest: Annotated[float, Field(gt=0, lt=1)] = 0.99
    """Largest singular value of a map: a matrix above it is shrunk as a whole, as a code must contract."""


class CodeReader(Pretrained):
    """A network that reads a code off the image, as it sees it on `side` pixels a side, in one pass."""

    params: CodeReaderParams

    @classmethod
    def laptop(cls, *, resolution: int = 256, seed: int = 0, seconds: float | None = None, **options: Any) -> Self:
        """The method with the weights in the package. It takes images of any resolution from the network's own on; the
        seed makes no difference, as nothing is drawn."""
        return cls(seconds=seconds, **options)

    @abstractmethod
    def read_off(self, network: nn.Module, image: Tensor) -> IFS:
        """The code in the frame, from an image (1,S,S) on the device."""

    def check_size(self, target: Tensor) -> None:
        side = self.params.side
        if len(target) < side:
            raise InputError(f"the network sees {side}² pixels, and the target has {len(target)}²; raise resolution to "
                             f"{side} or more")

    @full_precision()
    @torch.no_grad()
    def reconstruct(self, target: AnyTarget, *, on_step: OnStep | None = None, checkpoint: Checkpoint | None = None
                    ) -> CodeReconstruction:
        image = check_target(target)
        self.check_size(image)
        code = self.read_off(self.loaded()[0], resized(image, self.params.side)[None].to(self.device))
        if on_step:
            preview = render(code, resolution=self.params.side)
            on_step(Progress(1, 1.0, {"maps": len(code)}, preview, "network", code))
        return CodeReconstruction(code, "one pass of the network done", evaluations=0)
