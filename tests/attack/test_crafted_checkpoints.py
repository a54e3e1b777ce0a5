"""Checkpoints with a right checksum and wrong values: every tensor and every number of one is replaced by others, one
at a time. Whoever goes on from it ends, or is told in one short line why not."""

import random
from dataclasses import dataclass, replace

import pytest
import torch
from chaotic_helpers import OPTIMIZERS, fit
from crafted import crafted
from networks_helpers import TRAININGS, Stop, stopped_after
from rivals_helpers import TARGET, stopped_at

from fractal_exp import InputError
from fractal_exp.methods.base import FitDiverged
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.state import State
from fractal_exp.methods.population.cuckoo import Cuckoo
from fractal_exp.methods.population.evolutionary import Evolutionary
from fractal_exp.runtime.checkpoint import Checkpoint
from fractal_exp.training.loop import train

FEW = 12  # crafted checkpoints of each kind in the quick tests
SMALL = {"population": 8, "maps": 3, "generations": 6}
HUGE = 10**400
SWAPS = {"of another shape": lambda tensor: torch.zeros(7, 5), "empty": lambda tensor: tensor.new_zeros(0),
         "of another type": lambda tensor: tensor.to(torch.int16),
         "one more": lambda tensor: torch.stack([tensor, tensor]),
         "NaN": lambda tensor: torch.full_like(tensor.float(), float("nan")).to(tensor.dtype),
         "infinite": lambda tensor: torch.full_like(tensor.float(), float("inf")).to(tensor.dtype),
         "huge": lambda tensor: torch.full_like(tensor, 1e30 if tensor.is_floating_point() else 10**4)}


@dataclass
class Kind:
    """Something that saves itself: begin(checkpoint) is interrupted once it has, and go_on(checkpoint) ends it."""

    begin: object
    go_on: object


def searches(make, step=3):
    def begin(checkpoint):
        with pytest.raises(KeyboardInterrupt):
            make().reconstruct(TARGET, on_step=stopped_at(step), checkpoint=checkpoint)
    return Kind(begin, lambda checkpoint: make().reconstruct(TARGET, checkpoint=checkpoint))


def trainings(make):
    def begin(checkpoint):
        with pytest.raises(Stop):
            train(make(), on_step=stopped_after(7), checkpoint=checkpoint)
    return Kind(begin, lambda checkpoint: train(make(), checkpoint=checkpoint))


def collage():
    """The state alone is read back: a search that goes on takes seconds."""
    search = searches(lambda: Collage(seconds=20), step=2)
    return Kind(search.begin, lambda checkpoint: State.of(checkpoint.load(), "cpu").snapshot())


KINDS = {**{name: (lambda make=make: searches(lambda: fit(make(), iterations=5))) for name, make in OPTIMIZERS.items()},
         "evolutionary": lambda: searches(lambda: Evolutionary(**SMALL)),
         "cuckoo": lambda: searches(lambda: Cuckoo(**SMALL)),
         **{name: (lambda make=make: trainings(make)) for name, make in TRAININGS.items()}, "collage": collage}


def variants(snapshot):
    """(what was changed, the changed snapshot)."""
    for name, tensor in snapshot.tensors.items():
        for swap, change in SWAPS.items():
            yield f"{name} {swap}", replace(snapshot, tensors={**snapshot.tensors, name: change(tensor)})
        yield f"{name} gone", replace(snapshot, tensors={key: value for key, value in snapshot.tensors.items()
                                                         if key != name})
    for name in ("x", "optimizer/x", "best/0/x", "best/99/x", "a\nb" * 100, "optimizer/99/step", "current/weights"):
        yield f"{name!r:.20} added", replace(snapshot, tensors={**snapshot.tensors, name: torch.zeros(3)})
    for path, value, numbers in crafted(snapshot.numbers):
        if path and isinstance(numbers, dict):
            yield f"{path} {value!r:.60}", replace(snapshot, numbers=numbers)
    for value in (-1, 0, 1, 5, 10**9, HUGE, None, "x", 0.5, True, [1]):
        yield f"iteration {value!r:.60}", replace(snapshot, iteration=value)


QUICK = "gradient", "evolutionary", "neural_regression", "collage"
CASES = [*((name, True) for name in QUICK), *(pytest.param(name, False, marks=pytest.mark.slow) for name in KINDS)]


@pytest.mark.parametrize(("name", "few"), CASES)
def test_a_crafted_checkpoint_is_gone_on_from_or_refused(name, few, tmp_path):
    kind, checkpoint = KINDS[name](), Checkpoint(tmp_path / "f", 2, {"seed": 0})
    kind.begin(checkpoint)
    resumed = replace(checkpoint, resume=True)
    whole = resumed.load()
    kind.go_on(resumed)
    found = list(variants(whole))
    for what, snapshot in random.Random(name).sample(found, min(FEW, len(found))) if few else found:
        checkpoint.save(snapshot)
        try:
            kind.go_on(resumed)
        except (InputError, FitDiverged) as error:
            assert "\n" not in str(error) and len(str(error)) < 1000, f"{what}: {str(error)[:300]!r}"
        except Exception as error:
            raise AssertionError(f"{what}: {type(error).__name__}: {error}") from error
