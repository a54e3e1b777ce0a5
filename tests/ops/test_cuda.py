"""The CUDA kernels where there is no GPU: run in numba's simulator, compiled for three generations of GPUs, and the
messages to those who have none. `test_cuda_gpu` has the rest."""

import json
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from commands import run_here
from places import ROOT

from fractal_exp import IFS, InputError
from fractal_exp.ops import backends, chaos_game, cuda_launch, splat
from fractal_exp.ops.collage import Descent
from fractal_exp.rendering.still import render

HERE = Path(__file__).parent
needs_numba_cuda = pytest.mark.skipif(not cuda_launch.INSTALLED, reason="numba-cuda is not installed "
                                                                        "(pip install 'fractal-exp[cuda]')")


@needs_numba_cuda
@pytest.mark.slow
@pytest.mark.parametrize("cases", ["not slow", "slow"])
def test_kernels_in_the_simulator(cases):
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1", "CUDA_VISIBLE_DEVICES": ""}
    command = [sys.executable, "-m", "pytest", "-q", "-m", cases, "-p", "no:cacheprovider",
               str(HERE / "simulated_cuda.py")]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert "skipped" not in done.stdout


def kernels():
    """(name, kernel, types of its arguments) of every kernel."""
    from numba import typeof
    from numba import types as t

    from fractal_exp.ops.chaos import cuda_kernels as game
    from fractal_exp.ops.collage import cuda as cuda_collage
    from fractal_exp.ops.histogram import cuda as cuda_histogram
    from fractal_exp.ops.splatting import cuda_kernels as cuda_splat

    def array(dtype, dimensions):
        return t.Array(dtype, dimensions, "C")

    def named(values):  # built by name, so that a field added to the class is missed here and not in the compiler
        return t.NamedTuple(tuple(values), type(values))

    floats, longs = {n: array(t.float32, n) for n in (2, 3, 4)}, array(t.int64, 1)
    yield "chaos_game", game.forward_kernel, (
        floats[3], array(t.int64, 2), longs, floats[4], floats[4], array(t.uint16, 3))
    yield "chaos_game_backward", game.backward_kernel, (
        floats[3], longs, floats[4], floats[4], array(t.uint16, 3), floats[4], array(t.float64, 4))
    yield "assign", cuda_splat.assign_kernel, (floats[3], t.int64, t.int64, t.int64, array(t.int32, 1))
    yield "share_out", cuda_splat.share_out_kernel, (longs, t.int64, t.int64, t.int64, longs)
    yield "multiply", cuda_splat.multiply_kernel, (
        floats[2], longs, longs, t.int64, t.int64, t.int64, t.int64, t.float64, floats[3], floats[3])
    yield "combine", cuda_splat.combine_kernel, (longs, t.int64, floats[3], floats[3])
    yield "downsample", cuda_splat.downsample_kernel, (floats[3], t.int64, floats[3])
    yield "gather", cuda_splat.gather_kernel, (
        floats[2], longs, longs, floats[3], floats[3], t.int64, t.int64, t.float64, floats[2])
    measure = floats[3], floats[2], floats[2]  # maps, weights, samples
    yield "pushforward", cuda_collage.pushforward_kernel, (*measure, t.int64, t.int64, array(t.int64, 2))
    flat = array(t.float32, 1)
    target = named(cuda_collage.Target(samples=floats[2], roots=flat, mean=flat, covariance=floats[2], size=t.int64,
                                       grids=t.int64, floor=t.float64, known=flat))
    settings = named(cuda_collage.Settings(**{name: typeof(value) for name, value in vars(Descent(steps=1)).items()}))
    work = named(cuda_collage.Workspace(moments=floats[4], masses=array(t.int64, 2), bins=floats[2], slopes=floats[2],
                                        gradients=floats[3]))
    yield "descend", cuda_collage.descend_kernel, (*measure[:2], target, floats[2], longs, settings, work, flat)
    for mode, dtype in ((cuda_histogram.LIT, t.uint8), (cuda_histogram.COUNTED, t.int32)):
        yield f"throw_{mode}", cuda_histogram.KERNELS[mode], (
            array(t.float64, 2), longs, array(t.float64, 2), longs, array(t.int32, 1), t.int64, t.int64, t.int64,
            array(dtype, 2), longs)


@pytest.mark.slow
@needs_numba_cuda
@pytest.mark.parametrize("capability", [(8, 0), (9, 0, "a"), (10, 0, "a")], ids=lambda cc: "".join(map(str, cc)))
def test_kernels_compile_to_machine_code(capability):
    """By NVVM and nvJitLink, optimised as they are linked, as a launch has it done; neither needs a GPU or a driver."""
    from cuda.bindings import nvjitlink
    from numba import cuda

    architecture = "sm_" + "".join(map(str, capability))
    for name, kernel, signature in kernels():
        fast = kernel.targetoptions.get("fastmath", False)
        code, _ = cuda.compile(kernel.py_func, signature, cc=capability, fastmath=fast, device=False, abi="numba",
                               output="ltoir")
        linker = nvjitlink.create(3, [f"-arch={architecture}", "-lto", "-verbose"])
        nvjitlink.add_data(linker, nvjitlink.InputType.LTOIR, code, len(code), name)
        nvjitlink.complete(linker)
        log = bytearray(nvjitlink.get_info_log_size(linker))
        nvjitlink.get_info_log(linker, log)
        assert nvjitlink.get_linked_cubin_size(linker) > 0
        assert b" 0 bytes spill stores" in log, f"{name} spills its registers: {log.decode()}"
        nvjitlink.destroy(linker)


def test_the_cuda_backend_says_what_it_needs():
    code = torch.eye(2)[None] / 2, torch.zeros(1, 2)
    with pytest.raises(InputError, match=r"backend='cuda' needs float32 tensors on an NVIDIA GPU, and numba-cuda"):
        chaos_game(*code, backend="cuda")
    with pytest.raises(InputError, match="got torch.float32 on cpu"):
        splat(torch.zeros(3, 2), 8, backend="cuda")


def test_auto_takes_the_kernels_and_says_if_it_cannot(monkeypatch, caplog):
    on_gpu = torch.zeros(1, device="meta")  # a tensor of another device than the CPU, as far as a choice goes
    monkeypatch.setattr(cuda_launch, "DEVICE", "meta")
    monkeypatch.setattr(cuda_launch, "INSTALLED", True)
    assert backends.choose("auto", on_gpu) == "cuda"
    assert backends.choose("auto", on_gpu.double()) == "torch" and not caplog.records
    monkeypatch.setattr(cuda_launch, "INSTALLED", False)
    backends._say_that_it_is_slow.cache_clear()
    with caplog.at_level(logging.WARNING):
        assert [backends.choose("auto", on_gpu) for _ in range(3)] == ["torch"] * 3
    assert [record.message for record in caplog.records] == [caplog.messages[0]]
    assert "pip install 'fractal-exp[cuda]'" in caplog.messages[0]


@pytest.mark.parametrize(("device", "message"), [
    ("gpu", "images are drawn on cpu or cuda, got device='gpu'"), ("meta", "images are drawn on cpu or cuda"),
    pytest.param("cuda", r"needs an NVIDIA GPU with its driver, and numba-cuda",
                 marks=pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")),
])
def test_images_are_refused_on_devices_that_cannot_draw(device, message):
    with pytest.raises(InputError, match=message):
        render(IFS(torch.eye(2)[None] / 2, torch.zeros(1, 2)), device=device)


@pytest.mark.slow
def test_the_benchmark_of_a_gpu_rehearses_without_one(tmp_path):
    """A lease is too short to find a slip of the script on it."""
    from benchmarks import gpu

    status, printed = run_here(gpu, "--rehearse", "--perceptual", "lpips_squeeze", "--json", str(tmp_path / "gpu.json"))
    assert status == 0, printed
    report = json.loads((tmp_path / "gpu.json").read_text())
    assert [case["case"] for case in report["operations"]] == ["chaos game", "splat, paper", "splat, laptop"]
    assert all(case["plain_ms"] > case["floor_ms"] > 0 for case in report["operations"])
    assert {"rates", "views", "iteration", "fit", "environment"} <= set(report)
