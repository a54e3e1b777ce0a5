"""Freed memory stays with the process, for work that asks for the same sizes again and again."""

from __future__ import annotations

import torch

KEPT = 64 << 20  # bytes at most


def keep_freed() -> None:
    """Let the C library keep up to 64 MiB that were freed, instead of giving them back at once.

    The system clears every page that it hands out, which took a tenth of the time of a fit: its tensors of some
    megabytes come and go with every iteration. glibc takes the largest freed block of up to 32 MiB as a sign of what a
    program needs, and keeps twice as much (`M_TRIM_THRESHOLD` in mallopt(3)); so one such block is freed here without
    being used. Other C libraries are not moved by it.
    """
    torch.empty(KEPT // 2 - 8192, dtype=torch.uint8)  # 8 KiB less, for the block's own header
