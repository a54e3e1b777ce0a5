"""A GPU that is none: tensors that say they lie on one, and are computed by the CPU.

Inside `pretended()` our code and torch's see device="cuda". What a GPU's tensors refuse is refused: an operation on
tensors here and there, `numpy()`, a random generator of the other device. What waits for a GPU is counted.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten, tree_map, tree_unflatten

from fractal_exp.methods.chaotic import method as chaotic
from fractal_exp.methods.collage import method as collage
from fractal_exp.ops import cuda_launch
from fractal_exp.ops.chaos import cpu as cpu_chaos
from fractal_exp.ops.collage import cpu as cpu_collage
from fractal_exp.ops.splatting import cpu as cpu_splatting
from fractal_exp.rendering import still as render

aten = torch.ops.aten
GPU, STAND_IN, CPU = torch.device("cuda", 0), torch.device("meta"), torch.device("cpu")
COPIES = {aten._to_copy.default, aten.copy_.default}
INDEXING = {aten.index.Tensor, aten.index_put.default, aten.index_put_.default}
WAITS = {aten._local_scalar_dense.default, aten.equal.default, aten.nonzero.default, aten.masked_select.default,
         aten._unique2.default, aten.unique_dim.default, aten.unique_consecutive.default}


class OnGpu(Tensor):
    """A tensor of the GPU, around one of the CPU. To torch's C++ it is of the device `meta`, which has no data."""

    __torch_function__ = torch._C._disabled_torch_function_impl
    device = property(lambda self: GPU)
    is_cuda = property(lambda self: True)
    is_cpu = is_meta = property(lambda self: False)

    @staticmethod
    def __new__(cls, held: Tensor) -> OnGpu:
        tensor = Tensor._make_wrapper_subclass(cls, held.size(), strides=held.stride(), dtype=held.dtype,
                                               storage_offset=held.storage_offset(), device=STAND_IN)
        tensor.held = held
        return tensor

    @classmethod
    def __torch_dispatch__(cls, func: Any, types: Any, args: tuple = (), kwargs: dict | None = None) -> Any:
        raise AssertionError(f"{func} on a tensor of the pretended GPU, which is gone")

    def __repr__(self) -> str:
        return f"OnGpu({self.held})"


def _on_gpu(device: object) -> bool:
    return isinstance(device, str | torch.device) and torch.device(device).type in (GPU.type, STAND_IN.type)


def _indices(index: Any) -> Any:
    """Lists of an index as tensors, which torch would make on the stand-in, that is of nothing."""
    if isinstance(index, tuple):
        return tuple(_indices(part) for part in index)
    return torch.tensor(index, dtype=None if index else torch.int64) if isinstance(index, list) else index


class _Named(TorchFunctionMode):
    """Who asks for the GPU by name gets its stand-in, before torch looks for a driver."""

    def __torch_function__(self, func: Any, types: Any, args: tuple = (), kwargs: dict | None = None) -> Any:
        kwargs = dict(kwargs or {})
        if func is Tensor.new_tensor and isinstance(args[0], OnGpu):
            return torch.tensor(*args[1:], **{"dtype": args[0].dtype} | kwargs).to(STAND_IN)
        if func in (torch.tensor, torch.as_tensor) and _on_gpu(kwargs.get("device")):
            return func(*args, **kwargs | {"device": CPU}).to(STAND_IN)
        if "device" in kwargs and func is not torch.device and _on_gpu(kwargs["device"]):
            kwargs["device"] = STAND_IN
        if func is Tensor.tolist and isinstance(args[0], OnGpu):
            return args[0].cpu().tolist()
        if func in (Tensor.__getitem__, Tensor.__setitem__):
            args = (args[0], _indices(args[1]), *args[2:])
        if func is Tensor.to and len(args) > 1 and _on_gpu(args[1]):
            args = (args[0], STAND_IN, *args[2:])
        return func(*args, **kwargs)


class _Computed(TorchDispatchMode):
    """What every operation does, and what it refuses."""

    @classmethod
    def _should_skip_dynamo(cls) -> bool:
        return False  # or torch imports its compiler, and Triton with it, to be told to leave this alone

    def __init__(self) -> None:
        super().__init__()
        self.waits: Counter[str] = Counter()

    def __torch_dispatch__(self, func: Any, types: Any, args: tuple = (), kwargs: dict | None = None) -> Any:
        kwargs = dict(kwargs or {})
        tensors = [x for x in tree_flatten((args, kwargs))[0] if isinstance(x, Tensor)]
        there = any(isinstance(x, OnGpu) for x in tensors)
        goes = isinstance(args[0], OnGpu) if func is aten.copy_.default else there  # where the result will be
        if kwargs.get("device") is not None:
            goes = _on_gpu(kwargs["device"])
            kwargs["device"] = CPU
        if there and func not in COPIES:
            self._refuse(func, args, tensors)
        if goes and kwargs.get("generator") is not None:
            raise RuntimeError(f"{func}: expected a 'cuda' device type for generator but found 'cpu'")
        if self._waits(func, args, there, goes):
            self.waits[str(func)] += 1
        result = func(*tree_map(_held, args), **tree_map(_held, kwargs))
        first = func._schema.arguments[0].alias_info if func._schema.arguments else None
        if first is not None and first.is_write:  # in place
            return args[0]
        return tree_map(lambda x: OnGpu(x) if goes and isinstance(x, Tensor) else x, result)

    @staticmethod
    def _refuse(func: Any, args: tuple, tensors: list[Tensor]) -> None:
        if func in INDEXING:  # indices may lie on the CPU
            tensors = [args[0], *args[2:3]]
        if any(x.dim() and not isinstance(x, OnGpu) for x in tensors):
            raise RuntimeError(f"{func}: expected all tensors to be on the same device, found cuda:0 and cpu, of "
                               f"shapes {[tuple(x.shape) for x in tensors]}")

    @staticmethod
    def _waits(func: Any, args: tuple, there: bool, goes: bool) -> bool:
        if func is aten._to_copy.default:
            return there != goes
        if func is aten.copy_.default:
            return isinstance(args[0], OnGpu) != isinstance(args[1], OnGpu)
        if func in INDEXING:  # by a mask, or by indices that have to be brought there
            return there and any(x is not None and (x.dtype == torch.bool or not isinstance(x, OnGpu)) for x in args[1])
        return there and func in WAITS


def _held(x: Any) -> Any:
    return x.held if isinstance(x, OnGpu) else x


class _Lent(torch.autograd.Function):
    """A CPU backend's function of tensors of the GPU, all of them, and its gradient."""

    @staticmethod
    def forward(ctx: Any, run: Callable, *tensors: Tensor) -> Any:
        for x in tensors:
            assert isinstance(x, OnGpu), f"{run} got a tensor of the CPU"
        ctx.given = [x.held.detach().requires_grad_(x.requires_grad) for x in tensors]
        with torch.enable_grad():
            ctx.result = run(*ctx.given)
        return tree_map(lambda x: OnGpu(x.detach()), ctx.result)

    @staticmethod
    def backward(ctx: Any, cotangent: Tensor) -> tuple[Tensor | None, ...]:
        moving = [x for x in ctx.given if x.requires_grad]
        gradients = iter(torch.autograd.grad(ctx.result, moving, cotangent.held))
        return None, *(OnGpu(next(gradients)) if x.requires_grad else None for x in ctx.given)


def _lent(module: ModuleType, *names: str) -> SimpleNamespace:
    def lent(name: str) -> Callable:
        def run(*args: Any, **settings: Any) -> Any:
            leaves, form = tree_flatten(args)
            at = [i for i, x in enumerate(leaves) if isinstance(x, Tensor)]

            def alone(*tensors: Tensor) -> Any:
                given = list(leaves)
                for i, x in zip(at, tensors, strict=True):
                    given[i] = x
                return getattr(module, name)(*tree_unflatten(given, form), **settings)
            return _Lent.apply(alone, *(leaves[i] for i in at))
        return run
    return SimpleNamespace(**{name: lent(name) for name in names})


@contextmanager
def pretended() -> Iterator[Counter[str]]:
    """As if there were a GPU, its kernels those of the CPU. Yields how often each operation waited for it."""
    kernels = {"fractal_exp.ops.chaos.cuda": _lent(cpu_chaos, "chaos_game"),
               "fractal_exp.ops.splatting.cuda": _lent(cpu_splatting, "splat"),
               "fractal_exp.ops.collage.cuda": _lent(cpu_collage, "pushforward", "descend")}
    computed = _Computed()
    with pytest.MonkeyPatch.context() as patch, _Named(), computed:
        for name, module in kernels.items():
            patch.setitem(sys.modules, name, module)
        patch.setitem(render.SCATTER, "cuda", render.SCATTER["cpu"])
        patch.setattr(cuda_launch, "INSTALLED", True)
        for who in chaotic, collage, render:
            patch.setattr(who, "check_device", lambda device, *_: str(device))
        yield computed.waits
