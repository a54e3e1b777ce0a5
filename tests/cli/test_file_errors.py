"""Full disks, taken folders, damaged records and names too long, as fits and commands meet them: in one line."""

import errno
import multiprocessing
import signal
import subprocess
import sys
from contextlib import ExitStack
from functools import partial

import pytest
from full_disk import a_disk_that_takes
from train_helpers import train as fit

from fractal_exp import InputError
from fractal_exp.cli import commands, render, suite
from fractal_exp.cli.folders import FitFolder
from fractal_exp.cli.jobs import Outcome
from fractal_exp.cli.runs import NoRuns
from fractal_exp.runtime import files
from fractal_exp.tracking import Tracker

FORK = multiprocessing.get_context("fork")


@pytest.fixture
def train(picture, tmp_path):
    """A function that fits a cross, of the overrides given."""
    return partial(fit, "tracking=none", "target=image", f"target.path={picture}", f"output={tmp_path}")


def hold(folder, entered):
    with files.alone_in(folder, wait=False):
        entered.set()
        signal.pause()


def test_a_second_fit_in_a_folder_is_refused_at_once(train, tmp_path):
    entered = FORK.Event()
    holder = FORK.Process(target=hold, args=(tmp_path / "fits" / "fit", entered))
    holder.start()
    assert entered.wait(60)
    try:
        with pytest.raises(InputError, match=f"process {holder.pid} is at work in .*/fit; wait until it has ended, "
                                             "or choose another folder with name=NAME or output=FOLDER"):
            train()
        assert {path.name for path in (tmp_path / "fits" / "fit").iterdir()} == {".lock", "views"}
    finally:
        holder.kill()
        holder.join()


class Filling(Tracker):
    """What a fit secures before its second checkpoint fills the disk, until the fit ends."""

    def __init__(self):
        self.secured, self.full = 0, ExitStack()

    def secure(self):
        self.secured += 1
        if self.secured == 2:
            self.full.enter_context(a_disk_that_takes(100))

    def finish(self, status="FINISHED", error=None):
        self.full.close()


class OnAFullDisk(NoRuns):
    def start(self, *_, **__):
        return Filling()


def test_a_disk_that_fills_up_ends_a_fit_in_one_line_and_the_fit_goes_on_from_what_was_saved(train, tmp_path):
    train("name=whole", "resume=true")
    with pytest.raises(InputError, match="cannot write .*/checkpoint.safetensors: File too large; files may not be so "
                                         "large.*; what was saved before stays, and resume=true goes on from it"):
        train("resume=true", f"tracking._target_={__name__}.OnAFullDisk")
    folder = tmp_path / "fits" / "fit"
    assert (folder / "checkpoint.safetensors").exists() and not list(folder.glob(".*partial"))
    train("resume=true")
    assert (folder / "code.json").read_text() == (tmp_path / "fits" / "whole" / "code.json").read_text()


@pytest.mark.parametrize("key", ["name", "study", "output"])
def test_names_too_long_are_refused_with_what_to_shorten(train, tmp_path, key):
    with pytest.raises(InputError, match="File name too long; choose another with output=FOLDER, study=STUDY or "
                                         "name=NAME"):
        train(f"{key}={tmp_path if key == 'output' else ''}{'/' if key == 'output' else ''}{'x' * 300}")


@pytest.mark.parametrize(("main", "arguments", "size", "names"), [
    (suite.main, ["suite", "--count", "1", "--resolution", "64"], 100, "suite/codes/000.json"),
    (render.main, ["fern", "fern.gif", "--size", "64", "--points", "1e4", "--seconds", "0.1"], 200, "fern.gif"),
])
def test_a_full_disk_ends_a_command_in_one_line(main, arguments, size, names, folder, capsys):
    with pytest.raises(SystemExit) as end, a_disk_that_takes(size):
        main(arguments)
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert end.value.code == 2 and f"error: cannot write {folder / names}: File too large" in last
    assert not (folder / names).exists() and not list(folder.rglob(".*partial*"))


def test_a_reader_that_has_seen_enough_ends_a_command_without_a_word():
    lines = "import sys; print('a' * 100_000); sys.stdout.flush(); print('b')"
    program = ("from fractal_exp.cli import commands\n"
               f"commands.command('fractal-test', lambda options: exec({lines!r}), "
               "commands.command_parser('fractal-test', ''), [])")
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.read(10)
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


def test_what_the_system_refuses_a_command_is_one_line_but_a_closed_pipe_is_not_of_a_file(capsys):
    def work(error):
        def raise_it(options):
            raise error
        return raise_it

    parser = commands.command_parser("fractal-test", "")
    with pytest.raises(SystemExit) as end:
        commands.command("fractal-test", work(OSError(errno.ENOSPC, "No space left on device", "/x")), parser, [])
    assert end.value.code == 2
    assert capsys.readouterr().err == ("fractal-test: error: /x: No space left on device; free some space, or choose "
                                       "another disk\n")
    for error in (BrokenPipeError(errno.EPIPE, "Broken pipe"), ConnectionRefusedError(errno.ECONNREFUSED, "refused"),
                  OSError("a library's own words")):
        with pytest.raises(type(error)):
            commands.command("fractal-test", work(error), parser, [])


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"identity": 1, "scores": {}}', '{"identity": {}}',
                                  "[" * 9999, '{"uri": "sqlite://"}',
                                  '{"identity": {}, "scores": {"eval/f1": "good"}}'])
def test_damaged_records_are_refused_by_name(tmp_path, text):
    folder = FitFolder.open(tmp_path, "fit")
    folder.checkpoint.touch()
    for path, read in ((folder.path / "finished.json", lambda: folder.finished_scores({})),
                       (folder.path / "run.json", lambda: folder.run_to_resume("sqlite://")),
                       (Outcome.path(folder.path), lambda: Outcome.read(folder.path))):
        path.write_text(text)
        with pytest.raises(InputError, match=f"{path.name} is ") as error:
            read()
        assert "\n" not in str(error.value)
