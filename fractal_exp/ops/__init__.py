"""The differentiable operations: the chaos game and the splatting of its points.

Each public function checks its arguments, flattens the leading axes and calls a backend: `cpu` (numba, float32), `cuda`
(numba-cuda, float32, on torch's current stream, without waiting for the device), or `torch`, the twin in each folder's
`reference`, which specifies the other two. `auto` takes the fastest backend that accepts the tensors.
"""

from .chaos import chaos_game
from .splatting import splat

__all__ = ["chaos_game", "splat"]
