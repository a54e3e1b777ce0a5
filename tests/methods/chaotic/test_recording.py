"""Work that cannot be recorded in a CUDA graph. That a recorded fit is the plain one is shown on a GPU."""

from contextlib import nullcontext
from types import SimpleNamespace

import torch

from fractal_exp.methods.chaotic import cuda_graph
from fractal_exp.methods.chaotic.cuda_graph import WARM_UP, Recorded


class Refusing:
    """In the place of torch.cuda: a device that records nothing."""

    CUDAGraph = SimpleNamespace

    def Stream(self, device):  # noqa: N802 - torch's name
        return SimpleNamespace(device=device, wait_stream=lambda other: None)

    current_stream = Stream

    def stream(self, stream):
        return nullcontext()

    device = stream

    def graph(self, graph, stream):
        raise RuntimeError("operation not permitted when stream is capturing")


def test_what_cannot_be_recorded_goes_on_without_and_says_so_once(monkeypatch, caplog):
    monkeypatch.setattr(cuda_graph.torch, "cuda", Refusing())
    recorded, seeds = Recorded(lambda seed: 2.0 * seed[None], torch.device("cpu")), range(WARM_UP + 4)
    assert [float(recorded(seed)) for seed in seeds] == [2.0 * seed for seed in seeds]
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "cannot be recorded in a CUDA graph" in caplog.text and "not permitted" in caplog.text
