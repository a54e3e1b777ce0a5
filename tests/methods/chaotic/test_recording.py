"""What is recorded in a CUDA graph, on a stand-in for torch.cuda that remembers what was asked of it."""

from contextlib import nullcontext
from types import SimpleNamespace

import pytest
import torch

from fractal_exp.methods.chaotic import cuda_graph as recording
from fractal_exp.methods.chaotic.cuda_graph import WARM_UP, Recorded


class FakeCuda:
    """Replaying does what was recorded once more, for the seed's present value."""

    def __init__(self, work, refuses=False):
        self.work, self.refuses, self.inside, self.replays = work, refuses, [], 0

    def Stream(self, device):  # noqa: N802 - torch's name
        return SimpleNamespace(device=device, wait_stream=lambda other: None)

    current_stream = Stream

    def stream(self, stream):
        return nullcontext()

    def device(self, device):
        self.inside.append(device)
        return nullcontext()

    def CUDAGraph(self):  # noqa: N802
        return SimpleNamespace(replay=self.replay)

    def graph(self, graph, stream):
        self.inside.append(stream)
        if self.refuses:
            raise RuntimeError("operation not permitted when stream is capturing")
        return nullcontext()

    def replay(self):
        self.replays += 1
        self.recorded.result.copy_(self.work(self.recorded.seed))


def double(seed):
    return 2.0 * seed[None]


@pytest.fixture
def fake(monkeypatch):
    def build(refuses=False):
        cuda = FakeCuda(double, refuses)
        monkeypatch.setattr(recording.torch, "cuda", cuda)
        cuda.recorded = Recorded(double, torch.device("cpu"))
        return cuda
    return build


def test_work_is_recorded_once_on_its_own_device_and_replayed_for_any_seed(fake):
    cuda = fake()
    results = [cuda.recorded(seed) for seed in range(WARM_UP + 4)]
    assert [float(result) for result in results] == [2.0 * seed for seed in range(WARM_UP + 4)]
    assert cuda.replays == 4
    assert cuda.inside == [torch.device("cpu"), cuda.recorded.stream]


def test_what_cannot_be_recorded_goes_on_without_and_says_so_once(fake, caplog):
    cuda = fake(refuses=True)
    assert [float(cuda.recorded(seed)) for seed in range(WARM_UP + 4)] == [2.0 * seed for seed in range(WARM_UP + 4)]
    assert cuda.replays == 0
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "cannot be recorded in a CUDA graph" in caplog.text and "not permitted" in caplog.text
