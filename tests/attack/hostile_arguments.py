"""Seeded hostile calls of the operators, for a process of its own: `python hostile_arguments.py CALLS SEED`.

Each call has good arguments of which one to three are replaced. It is clean if it ends in an `InputError` of one line
or in a result. Anything else, an IndexError of a kernel with bounds checking first of all, is printed with its call.
The last line says how many were tried and how many were clean; a crash leaves no last line.
"""

from __future__ import annotations

import math
import random
import sys
import warnings
from collections.abc import Callable

import torch

from fractal_exp import IFS, InputError, ops
from fractal_exp.ops.collage import BinnedMeasure, Descent, collage_error, descend, orbit_bins, pushforward

G = 8  # cells a side of the measure
NUMBERS = [0, 1, -1, 2, 3, 7.5, True, False, None, "3", math.nan, math.inf, -math.inf, 1e-300, 1e300, 10**12,
           2**63, -2**63, 10**400, -10**30, [1], {}, torch.tensor(2), torch.zeros(0)]
SPOILERS: list[Callable[[torch.Tensor], object]] = [
    lambda t: t[..., :1], lambda t: t[:0], lambda t: t[0] if t.ndim else t, lambda t: t[None], lambda t: t.flatten(),
    lambda t: torch.zeros(0), lambda t: t.new_zeros(0, *t.shape[1:]), lambda t: torch.cat([t, t], -1),
    lambda t: t.double(), lambda t: t.half(), lambda t: t.to(torch.bfloat16), lambda t: t.int(), lambda t: t.bool(),
    lambda t: t.to(torch.complex64), lambda t: t.to("meta"), lambda t: t.to_sparse(),
    lambda t: torch.quantize_per_tensor(t.float(), 0.1, 0, torch.qint8),
    lambda t: t.float() * math.nan, lambda t: t.float() + math.inf, lambda t: t.float() * 1e30, lambda t: -t,
    lambda t: t.float() * 1e-40, lambda t: t + 3, lambda t: t * 0, lambda t: t - 100, lambda t: t * 2**40,
    lambda t: t.float().requires_grad_()[...], lambda t: t.mT if t.ndim > 1 else t.flip(0),
    lambda t: torch.stack([t, t], -1)[..., 0], lambda t: t[:1].expand(t.shape), lambda t: t.tolist(),
    lambda t: t.numpy(), lambda t: None, lambda t: "tensor", lambda t: t.to(torch.uint8),
]
BACKENDS = ["auto", "cpu", "torch", "cuda", "gpu", "", None, 3, ["cpu"]]
GRIDS = [0, 1, 2, 3, 4, 5, -1, True, 10**9, 2.0, None]


def spoilt(value: object, chance: random.Random) -> object:
    if isinstance(value, torch.Tensor):
        return chance.choice(SPOILERS)(value)
    return chance.choice(BACKENDS) if isinstance(value, str) else chance.choice(NUMBERS)


def good(generator: torch.Generator) -> dict[str, tuple[Callable[..., object], dict]]:
    """Every public operator with arguments that it takes."""
    def rand(*shape: int) -> torch.Tensor:
        return torch.rand(*shape, generator=generator)

    samples = rand(40, 3)
    bins = rand(G, G)
    code = {"linear": rand(2, 3, 2, 2) - 0.5, "offset": rand(2, 3, 2)}
    return {
        "chaos_game": (ops.chaos_game, code | {"trajectories": 3, "length": 20, "warmup": 5, "seed": 1,
                                               "probabilities": torch.full((3,), 1 / 3), "backend": "auto"}),
        "chaos_game with seeds": (ops.chaos_game, code | {"trajectories": 3, "length": 20,
                                                          "seed": torch.tensor([1, 2])}),
        "splat": (ops.splat, {"points": rand(2, 30, 2), "resolution": 6, "sigma_px": 1.5, "supersample": 2,
                              "backend": "auto"}),
        "measure": (BinnedMeasure, {"samples": samples, "bins": bins, "grids": 2}),
        "pushforward": (pushforward, {"maps": rand(2, 3, 6), "weights": rand(2, 3), "samples": samples, "size": G,
                                      "backend": "auto"}),
        "orbit_bins": (orbit_bins, {"maps": rand(2, 3, 6) - 0.5, "probabilities": torch.full((3,), 1 / 3), "size": G,
                                    "trajectories": 3, "length": 20, "warmup": 5, "seed": 1, "backend": "auto"}),
        "error": (lambda given, samples, measure, grids: collage_error(given, BinnedMeasure(samples, measure, grids)),
                  {"given": rand(2, G, G), "samples": samples, "measure": bins, "grids": 2}),
        "descend": (lambda samples, bins, grids, steps, rate, identity_radius, largest, tied, **others: descend(
            measure=BinnedMeasure(samples, bins, grids), how=Descent(
                steps, rate=rate, identity_radius=identity_radius, largest=largest, tied=tied), **others),
                    {"maps": rand(2, 3, 6), "weights": rand(2, 3), "samples": samples, "bins": bins, "grids": 2,
                     "steps": 2, "rate": 0.01, "identity_radius": 0.1, "largest": 0.99, "tied": False,
                     "backgrounds": rand(2, G, G), "chosen": torch.tensor([0, 1]), "backend": "auto"}),
        "code": (IFS, {"linear": rand(3, 2, 2) - 0.5, "offset": rand(3, 2), "probabilities": torch.full((3,), 1 / 3)}),
    }


def attempt(call: Callable[..., object], arguments: dict) -> str | None:
    """What went wrong, None if nothing did; a result that has gradients gives them, too."""
    try:
        result = call(**arguments)
        if isinstance(result, torch.Tensor) and result.requires_grad:
            result.sum().backward()
    except InputError as error:
        return "more than one line" if "\n" in str(error) else None
    except Exception as error:
        return f"{type(error).__name__}: {error}".splitlines()[0]
    return None


def main(calls: int, seed: int) -> None:
    warnings.simplefilter("ignore")
    chance, generator = random.Random(seed), torch.Generator().manual_seed(seed)
    clean = 0
    for number in range(calls):
        operators = good(generator)
        name = chance.choice(sorted(operators))
        call, arguments = operators[name]
        for key in chance.sample(sorted(arguments), min(len(arguments), chance.choice([1, 1, 1, 2, 3]))):
            try:
                arguments[key] = (chance.choice(GRIDS) if key == "grids" else spoilt(arguments[key], chance))
            except (RuntimeError, IndexError):  # torch itself cannot make that tensor
                continue
        wrong = attempt(call, arguments)
        clean += wrong is None
        if wrong:
            print(f"call {number}, {name}: {wrong}", flush=True)
    print(f"tried {calls}, clean {clean}")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
