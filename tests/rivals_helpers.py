"""What the tests of the methods that the paper compares with share."""

import torch

from fractal_exp import codes, suite
from fractal_exp.methods.base import Method
from fractal_exp.runtime.checkpoint import Checkpoint

TARGET = suite.target(codes.known("sierpinski_triangle"), 32)


def same(one, other):
    """Both searches found the same code, after as many evaluations and for the same reason."""
    for part in ("linear", "offset"):
        found, expected = (getattr(each.code, part) for each in (other, one))
        assert torch.equal(found, expected), f"{part} of the code differs by up to {(found - expected).abs().max():.3g}"
    assert (other.evaluations, other.stopped) == (one.evaluations, one.stopped), "the search ended in another way"


def stopped_at(step: int):
    def on_step(progress):
        if progress.step == step:
            raise KeyboardInterrupt
    return on_step


def check_it_resumes_bit_for_bit(make, path, every: int = 2):
    """Interrupted after an odd number of steps, and once more from a save, a search ends as if it had not been."""
    whole = make().reconstruct(TARGET)
    for at in (1, 3):
        try:
            make().reconstruct(TARGET, on_step=stopped_at(at), checkpoint=Checkpoint(path, every, {}, resume=at > 1))
        except KeyboardInterrupt:
            pass
        else:
            raise AssertionError("it was to be interrupted")
    steps = []
    resumed = make().reconstruct(TARGET, on_step=lambda progress: steps.append(progress.step),
                                 checkpoint=Checkpoint(path, every, {}, resume=True))
    assert steps[0] == 4, "it goes on behind the interruption"
    same(whole, resumed)


def told(method: Method) -> list:
    seen = []
    method.reconstruct(TARGET, on_step=seen.append)
    return seen
