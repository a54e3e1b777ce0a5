import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fractal_exp.runtime import jit

SOURCE = Path(jit.__file__).parents[1]
QUICKLY_COMPILED = ("import fractal_exp, numpy as np; from fractal_exp.ifs.address_tree import lowered\n"
                    "{before}\n"
                    "none = np.zeros((1, 4))\n"
                    "table = lowered(np.ones(4), none.astype(int), np.zeros((1, 4, 2)), none, 0.0, 2)\n"
                    "print(table.tolist() == [0.0] * 4)")


def test_kernels_compile_where_nothing_can_be_cached():
    scope = {}
    exec("def twice(x):\n    return 2 * x", scope)  # a function without a file has no place in any cache
    assert jit.kernel()(scope["twice"])(21) == 42


def test_an_interrupt_in_a_kernel_stays_an_interrupt():
    def interrupted():
        inner = SystemError("_numba_unpickle returned a result with an exception set")
        inner.__cause__ = KeyboardInterrupt()
        raise SystemError("CPUDispatcher returned a result with an exception set") from inner

    def broken():
        raise SystemError("something else")

    interrupted.overloads = broken.overloads = {}  # as of a function that numba has compiled
    with pytest.raises(KeyboardInterrupt):
        jit.called(interrupted)()
    with pytest.raises(SystemError, match="something else"):
        jit.called(broken)()


SEARCHED = """
import fractal_exp, hashlib, torch
from fractal_exp import codes, ops, suite
from fractal_exp.cameras.levels import Density
from fractal_exp.cameras.params import CameraParams
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.bins import binned
from fractal_exp.ops.collage import Descent, descend, pushforward
from fractal_exp.runtime import threads
threads.use(1)
code, levels = attractor.normalize(codes.known("fern")), Density(CameraParams())
measure = binned(levels.measure(suite.target(code, 128)), 64)
maps, weights = affine.from_code(code)[None] + 0.01, torch.full((1, 4), 0.25)
found = [*descend(maps, weights, measure, Descent(40)), *descend(maps, weights, measure, Descent(40, tied=True)),
         pushforward(maps, weights, measure.samples, 64), ops.chaos_game(code.linear, code.offset, trajectories=100,
         length=200, seed=0), levels.render(code, 128, 0)]
print([hashlib.sha256(each.numpy().tobytes()).hexdigest() for each in found])
"""


def test_no_kernel_that_a_search_branches_on_may_reorder_its_sums():
    """By its flags; that the sums then come out alike is shown below."""
    assert "reassoc" not in jit.FUSED and jit.FUSED < jit.FAST
    for operation in ("collage", "occupancy", "sequences"):
        source = "".join(path.read_text() for path in (SOURCE / "ops" / operation).glob("cpu*.py"))
        assert "fastmath=FUSED" in source
        assert set(re.findall(r"fastmath=(\w+)", source)) == {"FUSED"} and "FAST" not in source.replace("FUSED", "")


@pytest.mark.slow
def test_a_process_that_compiles_the_kernels_of_a_search_and_one_that_loads_them_round_alike(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    run = [sys.executable, "-c", SEARCHED]
    compiled, loaded = (subprocess.run(run, env=environment, capture_output=True, text=True, check=True).stdout
                        for _ in range(2))
    assert list(tmp_path.rglob("*.nbi")) and compiled == loaded


def use_kernels(folder: Path, before: str = "") -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-c", QUICKLY_COMPILED.format(before=before)], capture_output=True,
                          text=True, env=os.environ | {"NUMBA_CACHE_DIR": str(folder)})


@pytest.fixture(scope="module")
def filled_cache(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cache")
    assert use_kernels(folder).stdout == "True\n"
    return folder


DAMAGE = {"empty": lambda data: b"", "cut off": lambda data: data[:len(data) // 2], "nonsense": lambda _: b"\x80" * 999}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_cache_is_said_once_and_made_anew(filled_cache, tmp_path, kind, damage):
    folder = tmp_path / "cache"
    shutil.copytree(filled_cache, folder)
    files = list(folder.rglob(f"*.{kind}"))
    for file in files:
        file.write_bytes(DAMAGE[damage](file.read_bytes()))
    first, second = use_kernels(folder), use_kernels(folder)
    assert files and first.stdout == second.stdout == "True\n", first.stderr
    assert first.stderr.count("compiled kernels cannot be kept") == 1 and len(first.stderr.splitlines()) == 1
    assert second.stderr == ""


def test_a_full_disk_costs_the_cache_alone(tmp_path):
    """A limit on the size of files stands for the disk; with the signal ignored, writing raises an OSError."""
    limit = ("import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
             "resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))")
    done = use_kernels(tmp_path, limit)
    assert done.stdout == "True\n", done.stderr
    assert done.stderr.count("compiled kernels cannot be kept") == 1 and len(done.stderr.splitlines()) == 1
