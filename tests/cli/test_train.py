"""The command line as users meet it, at sizes that take moments."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from commands import run_here
from omegaconf import OmegaConf
from PIL import Image
from processes import end_of, wait_for
from train_helpers import TINY, own_method, train

from fractal_exp import IFS, InputError
from fractal_exp.cli import composed as program
from fractal_exp.cli import interruption, start
from fractal_exp.inversion import Inversion
from fractal_exp.tracking import read_artifact, read_series, runs_frame


def command(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-m", "fractal_exp.cli", "train", *TINY, *arguments], text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_a_picture_is_fitted_scored_kept_and_tracked(picture, tmp_path, capsys):
    scores = train("target=image", f"target.path={picture}", f"output={tmp_path}")
    folder = tmp_path / "fits" / "fit"
    assert len(IFS.load(folder / "code.json")) == 10
    assert (folder / "code.html").read_text().startswith("<!doctype html>")
    assert OmegaConf.load(folder / "config.yaml").iterations == 6
    assert {p.name for p in (folder / "views").iterdir()} >= {"target.png", "result.png", "comparison.png"}
    assert set(scores) == {"eval/f1", "eval/iou", "eval/psnr", "eval/ssim", "time/fit_seconds"}
    assert not (folder / "checkpoint.safetensors").exists()
    printed = capsys.readouterr().out
    found = Inversion.load(folder)
    assert found.stopped == "all 6 iterations done"
    assert [stage.name for stage in found.history] == [f"iterations from {k}" for k in range(1, 7)]
    assert "stopped    all 6 iterations done" in printed
    assert found.verdict.kind != "recovered" and f"verdict    {found.verdict.words}\n" in printed
    assert "may help" not in printed, "no command made this fit that could be typed again"
    assert "no perceptual term in this objective" in printed and "inverted" in printed and str(folder) in printed

    uri = f"sqlite:///{tmp_path / 'mlflow.db'}"
    run = runs_frame(uri, "fits").iloc[0]
    assert read_artifact(uri, run["run_id"], "code.html") == (folder / "code.html").read_bytes()
    assert run["status"] == "FINISHED"
    assert run["metrics.eval/f1"] == pytest.approx(scores["eval/f1"])
    assert run["tags.variant"] == "full" and run["tags.perceptual"] == "none" and run["tags.scale"] == "smoke"
    assert run["params.model.maps"] == "10" and run["params.optimizer.lr"] == "0.01"
    assert "**cross** by chaotic (full, smoke scale)" in run["tags.mlflow.note.content"]
    series = read_series(uri, run["run_id"], "train/loss")
    assert list(series["step"]) == [1, 2, 3, 4, 5, 6]
    assert any(file.name.startswith("strip+step+0") for file in tmp_path.glob("mlartifacts/*/artifacts/images/*"))


@pytest.mark.parametrize("pen", [None, 0.1])
def test_what_a_method_says_of_the_camera_draws_the_pictures_of_a_fit(pen, picture, tmp_path):
    across, along = [[0.5, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.5]]
    cross = IFS([across, across, along, along], [[0.4, 0.0], [-0.4, 0.0], [0.0, 0.4], [0.0, -0.4]])
    scores = train("target=image", f"target.path={picture}", f"output={tmp_path}", "tracking=none",
                   *own_method(tmp_path, cross, pen))
    folder = tmp_path / "fits" / "fit"
    shown = np.asarray(Image.open(folder / "views" / "result.png").convert("L"))
    redrawn = np.asarray(Image.open(folder / "redrawn.png").convert("L"))
    assert bool((shown == redrawn).all()) == (pen is not None)
    assert scores["eval/f1"] < 0.5, "every pixel of the attractor counts, whatever the pen"


def test_a_finished_fit_is_not_repeated_on_resume_but_another_is_refused(picture, tmp_path, capsys):
    settings = ["target=image", f"target.path={picture}", f"output={tmp_path}", "tracking=none"]
    first = train(*settings)
    assert train(*settings, "resume=true") == first
    assert "finished; resume=false fits it again" in capsys.readouterr().out
    assert train(*settings)["eval/f1"] == first["eval/f1"]
    assert "held this fit, finished; it is fitted again (resume=true takes it as it is)" in capsys.readouterr().out
    with pytest.raises(InputError, match="seed: 0 there, 1 now"):
        train(*settings, "resume=true", "seed=1")


@pytest.fixture
def heard():
    """Where nohup started the tests, they ignore the end of a terminal, and so does all that they start."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("heard", "signals_are_heard")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupt_is_answered_at_once_and_raised_again_if_it_got_lost(number, capfd):
    interruption.listen("stopping; work is being kept")
    interruption.check()
    for _ in range(2):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(number)
    assert capfd.readouterr().err == "\nstopping; work is being kept\n"
    with pytest.raises(KeyboardInterrupt):
        interruption.check()
    interruption.listen()
    interruption.check()


CLOSED = """
import sys, time
from fractal_exp.cli import interruption

interruption.listen("stopping")
try:
    print("ready", flush=True)
    time.sleep(600)
except KeyboardInterrupt:
    time.sleep(1)
    print("to nobody", flush=True)
    with open(sys.argv[1], "w") as kept:
        kept.write("kept")
"""


@pytest.mark.usefixtures("heard")
def test_what_was_found_is_kept_where_the_terminal_is_closed(tmp_path):
    ours, theirs = os.openpty()
    process = subprocess.Popen([sys.executable, "-c", CLOSED, tmp_path / "kept"], stdin=theirs, stdout=theirs,
                               stderr=theirs, start_new_session=True)
    os.close(theirs)
    with open(ours, "rb", buffering=0) as terminal:  # the end of the line may come on its own
        assert terminal.readline().strip() == b"ready"
    for _ in range(2):  # by the system and by the shell
        process.send_signal(signal.SIGHUP)
        time.sleep(0.2)
    # The second may come when all is kept and Python, as it ends, no longer hears signals.
    assert process.wait(60) in (0, -signal.SIGHUP) and (tmp_path / "kept").read_text() == "kept"


LOADING = """
import contextlib, signal

with contextlib.suppress(KeyboardInterrupt):
    signal.raise_signal(signal.SIGINT)
raise ImportError("half a library")  # what an interrupted import may end in
"""


@pytest.mark.usefixtures("signals_are_heard")
def test_an_interrupt_while_libraries_load_is_one_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "half_a_command.py").write_text(LOADING)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SystemExit) as left:
        start.start("fractal-train", "half_a_command")
    assert left.value.code == 130 and capsys.readouterr().err == "\nfractal-train: interrupted\n"


def test_an_interrupt_saves_and_says_how_to_go_on(picture, tmp_path):
    process = command("target=image", f"target.path={picture}", f"output={tmp_path}", "tracking=none",
                      "iterations=100000", "checkpoint_every=1000000", "method.previews=5000")
    folder = tmp_path / "fits" / "fit"
    wait_for((folder / "views" / "preview.png").exists, "waited for a preview", process)
    process.send_signal(signal.SIGINT)
    _, errors = end_of(process)
    assert process.returncode == 130 and "resume=true goes on" in errors and "Traceback" not in errors, errors
    with pytest.raises(InputError, match="another configuration: iterations: 100000 there, 6 now"):
        train("target=image", f"target.path={picture}", f"output={tmp_path}", "tracking=none", "resume=true")


def test_a_changed_picture_is_not_gone_on_with(picture, tmp_path):
    copy = tmp_path / "copy.png"
    copy.write_bytes(picture.read_bytes())
    settings = ["target=image", f"target.path={copy}", f"output={tmp_path}", "tracking=none"]
    train(*settings)
    Image.open(picture).rotate(45, fillcolor=255).save(copy)
    with pytest.raises(InputError, match="target_image"):
        train(*settings, "resume=true")


def test_different_fits_have_different_folders_unless_named(picture, tmp_path):
    settings = ["target=image", f"target.path={picture}", f"output={tmp_path}", "tracking=none"]
    for maps in (2, 3):
        train(*settings, "name=null", f"model.maps={maps}")
    names = [path.name for path in (tmp_path / "fits").iterdir()]
    assert len(names) == 2 and all(name.startswith("cross-chaotic-full-smoke-seed0-") for name in names)
    train(*settings)
    with pytest.raises(InputError, match="holds a fit of another configuration: .*name=NAME"):
        train(*settings, "model.maps=3")


def test_an_unfinished_fit_that_is_not_resumed_is_kept_aside(picture, tmp_path, capsys):
    folder = tmp_path / "fits" / "fit"
    folder.mkdir(parents=True)
    (folder / "checkpoint.safetensors").write_bytes(b"earlier work")
    train("target=image", f"target.path={picture}", f"output={tmp_path}", "tracking=none")
    assert (folder / "checkpoint.previous-1.safetensors").read_bytes() == b"earlier work"
    assert "checkpoint is kept as" in capsys.readouterr().out


BAD = {
    "missing file": (["target=image", "target.path=nothing.png"], "nothing.png"),
    "unknown code": (["target.name=fren"], "no classic code is called 'fren'; did you mean 'fern'"),
    "no maps": (["model.maps=0"], "N must be at least 1, got 0"),
    "unknown perceptual distance": (["perceptual=lpips"], "no perceptual distance 'lpips'"),
    "missing weights": (["perceptual=lpips_alex", "perceptual_weights=none.pth"], "none.pth"),
    "a picture whose inner part is too small": (["target=retina", "perceptual=fractal"],
                                                "fractal needs pictures .*inner 24 px of 32; raise resolution to 42"),
    "views too small for SSIM": (["resolution=64", "evaluation.resolution=12"],
                                 "SSIM needs pictures of at least 13 px a side, got 12; raise evaluation.resolution"),
    "views whose inner part is too small": (["perceptual=fractal", "resolution=64", "evaluation.resolution=41"],
                                            "inner 31 px of 41; raise evaluation.resolution to 42"),
    "wrong device": (["device=gpu"], "there is no device 'gpu'"),
    "wrong evaluation device": (["evaluation.device=tpu"], "images are drawn on cpu or cuda"),
    "wrong backend": (["backend=magic"], "backend must be one of auto, cpu, cuda, torch"),
    "resolution without mip levels": (["resolution=48"], "power of two"),
    "no checkpoint interval": (["checkpoint_every=0"], "at least 1, got 0"),
    "unknown views": (["evaluation.views=all"], "views must be one of"),
    "no supersampling": (["evaluation.supersample=0"], "evaluation.supersample must be an integer of at "
                                                         "least 1, got 0"),
    "too much supersampling": (["evaluation.supersample=65"], "evaluation.supersample must be an integer of at most"),
    "a truth value for a resolution": (["evaluation.resolution=true"], "evaluation.resolution must be an integer"),
    "unknown evaluation option": (["+evaluation.zoom=3"], "'zoom' is none of them"),
    "a float for a count": (["model.trajectories=2e2"], "model.trajectories: .*integer, got 200.0"),
    "too many threads": (["threads=1000"], "threads must be between 1 and"),
    "unwritable output": (["output=/proc/nowhere"], "cannot write to the output folder /proc/nowhere"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_before_any_work(name, folder):
    overrides, message = BAD[name]
    output = [] if any(o.startswith("output=") for o in overrides) else [f"output={folder}"]
    with pytest.raises(InputError, match=message):
        train(*output, *overrides)
    assert not (folder / "mlflow.db").exists() and not (folder / "fits" / "fit" / "config.yaml").exists()


def test_the_command_prints_an_error_as_one_line(tmp_path):
    status, printed = run_here(program, *TINY, "target=image", "target.path=nothing.png", f"output={tmp_path}")
    assert status == 2
    assert re.fullmatch(r"fractal-train: error: .*nothing\.png.*\n", printed), printed


def test_importing_the_package_is_light():
    code = "import sys, fractal_exp; print([m for m in ('numba', 'mlflow', 'lpips', 'matplotlib', 'hydra', 'kornia', " \
           "'skimage', 'torch') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], text=True, capture_output=True, check=True, env=os.environ)
    assert json.loads(out.stdout.replace("'", '"')) == []
