"""What is freed stays with the process."""

import platform
import subprocess
import sys

import pytest

FAULTS = """
import resource
import torch
from fractal_exp.runtime.memory import keep_freed

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    parts = [torch.ones(1 << 20) for _ in range(14)]  # 4 MiB each
    del parts
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

keep_freed()
print(sum([faults() for _ in range(8)][4:]))  # the first ones fill what is kept
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have rules of their own")
def test_freed_memory_is_not_asked_for_again():
    faults = subprocess.run([sys.executable, "-c", FAULTS], check=True, capture_output=True, text=True).stdout
    assert int(faults) < 100
