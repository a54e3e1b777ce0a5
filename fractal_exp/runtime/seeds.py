"""Independent random streams derived from one seed, so that a fit has no generator state to save."""

from __future__ import annotations

import hashlib

import torch


def derive(seed: int, *path: int | str) -> int:
    """A 63-bit seed for the stream named by `path` (purpose, iteration, …) under `seed`; the same on every machine."""
    name = "/".join(str(part) for part in (seed, *path)).encode()
    return int.from_bytes(hashlib.blake2b(name, digest_size=8).digest(), "big") >> 1


def generator(seed: int, *path: int | str) -> torch.Generator:
    """A CPU generator for the stream named by `path` under `seed`."""
    return torch.Generator().manual_seed(derive(seed, *path))
