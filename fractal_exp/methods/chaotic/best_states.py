"""The best states of a noisy run."""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor

from .model import Parameters


class BestStates:
    """Keeps the `capacity` states of lowest loss, by value, no two within `spacing` iterations of each other.

    The spacing keeps one lucky stretch from filling all places. `states`, `losses` and `iterations` run in parallel,
    the best first.
    """

    def __init__(self, capacity: int, spacing: int = 1):
        self.capacity, self.spacing = capacity, spacing
        self._entries: list[tuple[float, int, dict[str, Tensor]]] = []

    @property
    def losses(self) -> list[float]:
        return [loss for loss, _, _ in self._entries]

    @property
    def iterations(self) -> list[int]:
        return [iteration for _, iteration, _ in self._entries]

    @property
    def states(self) -> list[dict[str, Tensor]]:
        return [state for _, _, state in self._entries]

    def offer(self, loss: float, iteration: int, state: Parameters) -> None:
        """Keep this state if it is among the best. The caller hands over a copy."""
        neighbours = [entry for entry in self._entries if abs(entry[1] - iteration) < self.spacing]
        if any(entry[0] <= loss for entry in neighbours):
            return
        rest = [entry for entry in self._entries if abs(entry[1] - iteration) >= self.spacing]
        self._entries = sorted([*rest, (loss, iteration, dict(state))], key=lambda entry: entry[:2])[: self.capacity]

    def clear(self) -> None:
        """Forget all."""
        self._entries = []

    def choose(self, score: Callable[[Parameters, int], float], draws: int) -> dict[str, Tensor]:
        """The state with the lowest mean of score(state, draw) over `draws` common draws."""
        return min(self.states, key=lambda state: sum(score(state, draw) for draw in range(draws)))
