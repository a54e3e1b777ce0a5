"""The differentiable operations: the chaos game and the splatting of its points.

Each public function checks what it is given, flattens the leading axes and hands over to a backend: `cpu` (numba,
float32), `cuda` (numba-cuda, float32, on torch's current stream, never waiting for the device), or `torch`, the twin in
each folder's `reference` that specifies them. `auto` takes the fastest that can.
"""

from .chaos import chaos_game
from .splatting import splat

__all__ = ["chaos_game", "splat"]
