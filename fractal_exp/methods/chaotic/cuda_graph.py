"""One piece of GPU work, recorded in a CUDA graph and replayed: hundreds of launches for the price of one."""

from __future__ import annotations

import logging
from collections.abc import Callable

import torch
from torch import Tensor

log = logging.getLogger(__name__)

WARM_UP = 3  # runs before the recording: they compile, choose algorithms and allocate


class Recorded:
    """`work`, which must do the same on the same tensors every time, and depend on nothing else but a seed.

    work takes the seed as a tensor () int64 on the device and returns one tensor; whatever it changes in place it
    changes at every run. The first runs are plain ones, and so are all, with a warning, if it cannot be recorded, as
    where it waits for the device.
    """

    def __init__(self, work: Callable[[Tensor], Tensor], device: torch.device):
        self.work, self.runs = work, 0
        self.seed = torch.zeros((), dtype=torch.int64, device=device)
        self.stream = torch.cuda.Stream(device)
        self.graph: torch.cuda.CUDAGraph | None = None

    def __call__(self, seed: int) -> Tensor:
        """What work returns for this seed, as a copy by value."""
        self.seed.fill_(seed)
        if self.runs == WARM_UP:
            self._record()
        self.runs += 1
        if self.graph is None:
            return self._run_beside()
        self.graph.replay()
        return self.result.clone()

    def _record(self) -> None:
        graph = torch.cuda.CUDAGraph()
        try:  # else torch would record on the current device, whichever that is
            with torch.cuda.device(self.seed.device), torch.cuda.graph(graph, stream=self.stream):
                self.result = self.work(self.seed)
        except RuntimeError as error:  # nothing was computed, so nothing is lost
            log.warning("this work cannot be recorded in a CUDA graph and goes on without, which is slower: %s", error)
        else:
            self.graph = graph

    def _run_beside(self) -> Tensor:
        """On a stream of its own, as recording does: autograd must not remember the one that all else runs on."""
        current = torch.cuda.current_stream(self.seed.device)
        self.stream.wait_stream(current)
        with torch.cuda.stream(self.stream):
            result = self.work(self.seed)
        current.wait_stream(self.stream)
        return result.clone()
