"""What a sweep is going to take, told before it starts."""

import shutil

import pytest
import torch
from commands import run_here
from configured import composed
from omegaconf import OmegaConf
from places import ROOT
from train_helpers import own_task

from fractal_exp.cli import cost, sweep
from fractal_exp.methods.base import Method, Progress


class Clocked(Method):
    """A method of so many steps of two seconds, the first of which takes ten, by a clock of its own."""

    def __init__(self, steps: int):
        self.now, self.steps, self.done = 0, steps, 0

    def reconstruct(self, target, *, on_step=None, checkpoint=None):
        assert target.shape == (32, 32) and 0 < float(target.mean()) < 1
        for step in range(1, self.steps + 1):
            self.now += 10 if step == 1 else 2
            self.done = step
            on_step(Progress(step, step / self.steps))


def test_a_few_steps_tell_the_whole_and_what_compiles_is_left_out():
    long, short = Clocked(1000), Clocked(1)
    assert cost.watched(long, 32, lambda: long.now) == pytest.approx(2000) and long.done == 2
    told = cost.watched(short, 32, lambda: short.now)
    assert told == pytest.approx(10), "a fit that ends sooner is the answer itself"


def test_jobs_are_added_up_by_method_and_shared_by_workers():
    def config(seconds=None):
        method = {"_target_": f"{__name__}.Clocked", "steps": 5} if seconds is None else {"seconds": seconds}
        return OmegaConf.create({"method": method, "resolution": 32, "threads": 1})

    assert cost.estimate({"a": (4, config(90)), "b": (2, config(3600))}, 2) == "about 63 min: 4 × 90 s + 2 × 60 min"
    assert cost.estimate({"a": (4, config(90)), "of its own": (1, config())}, 1) == (
        "about 6 min: 4 × 90 s; without of its own")
    assert cost.estimate({"of its own": (1, config())}, 1) == ""


@pytest.mark.parametrize("words", [["method=chaotic"], ["method=cuckoo"]])
def test_the_methods_of_known_length_are_tried(words):
    seen = []

    def watch(method, side):
        seen.append((type(method).__name__.lower(), side))
        return 500

    threads = torch.get_num_threads()
    try:
        said = cost.estimate({"it": (3, composed(*words, "scale=smoke", "threads=1"))}, 1, watch)
    finally:
        torch.set_num_threads(threads)
    assert said == "about 25 min: 3 × 8 min" and seen == [(words[0].split("=")[1], 64)]


def scores(config):
    """In place of a fit."""
    return {"eval/f1": 0.5}


def test_a_sweep_says_it_before_its_first_job_and_leaves_out_what_is_finished(tmp_path):
    shutil.copy(ROOT / "sweeps" / "function_count.yaml", tmp_path)  # one's own folder is looked through, not ours
    words = ["function_count", *own_task(tmp_path, scores), "sweep.count=1", "model.maps=3,5", "scale=smoke",
             "seconds=500", "tracking=none", f"output={tmp_path}"]
    first = run_here(sweep, *words)[1]
    assert first.index("  about 17 min: 2 × 8 min, on cpu\n") < first.index("1/2")
    folder = next((tmp_path / "function_count").glob("smoke-*")) / "seed=0,model.maps=3"
    (folder / "finished.json").write_text("{}")
    assert "  about 8 min: 1 × 8 min, on cpu\n" in run_here(sweep, *words)[1]
