"""Writing whole files, many at once; being alone in a folder."""

import multiprocessing
import os
import threading
import time

import pytest
import torch

from fractal_exp import IFS, InputError
from fractal_exp.cli.folders import FitFolder
from fractal_exp.images.pixels import write_image
from fractal_exp.runtime.checkpoint import Checkpoint, Snapshot
from fractal_exp.runtime.files import alone_in, replacing, write_atomically

FORK = multiprocessing.get_context("fork")  # tensors are small: torch's thread pool does not survive it
VERSIONS = range(6)


def save_often(path, version):
    """From three threads, a version of its own each time, as every kind of file that is written whole."""
    failures = []

    def save():
        try:
            for _ in range(10):
                write_atomically(path / "text", f"{version}" * 10_000)
                Checkpoint(path / "checkpoint").save(Snapshot(version, {"x": torch.full((1000,), float(version))}))
                write_image(path / "image.png", torch.full((20, 20), version / 255))
                IFS([[[0.5, 0], [0, 0.5]]], [[version, 0]]).save(path / "code.json")
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=save) for _ in range(3)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    os._exit(len(failures))


def test_many_threads_and_processes_save_to_one_path(tmp_path):
    processes = [FORK.Process(target=save_often, args=(tmp_path, version)) for version in VERSIONS]
    [process.start() for process in processes]
    [process.join() for process in processes]
    assert [process.exitcode for process in processes] == [0] * len(VERSIONS), "every save succeeds"
    assert (tmp_path / "text").read_text() in {f"{version}" * 10_000 for version in VERSIONS}
    snapshot = Checkpoint(tmp_path / "checkpoint", resume=True).load()
    assert torch.equal(snapshot.tensors["x"], torch.full((1000,), float(snapshot.iteration)))
    assert float(IFS.load(tmp_path / "code.json").offset[0, 0]) in VERSIONS
    assert sorted(os.listdir(tmp_path)) == ["checkpoint", "code.json", "image.png", "text"], "nothing is left over"


def write(path, writing, leave):
    with replacing(path):
        writing.set()
        leave.wait(60)


def test_what_a_killed_process_left_goes_with_a_later_write_but_not_what_is_being_written(tmp_path):
    other, leave = begun(write, tmp_path / "file")
    [written] = tmp_path.glob(".file.*.partial")
    left = tmp_path / ".file.0123456789ab.partial"
    left.write_bytes(b"half")
    os.utime(left, (time.time() - 7200,) * 2)
    write_atomically(tmp_path / "file", b"whole")
    assert not left.exists() and written.exists()
    leave.set()
    other.join()


def test_a_fit_that_begins_removes_what_a_killed_one_left_and_nothing_else(tmp_path):
    folder = FitFolder.open(tmp_path, "fit")
    left = [folder.path / ".checkpoint.safetensors.0123456789ab.partial",
            folder.views / ".preview.png.ba9876543210.partial"]
    kept = [folder.checkpoint, folder.path / ".notes.partial", folder.path / ".lock"]
    for path in (*left, *kept):
        path.write_bytes(b"half")
    folder.begin("seed: 0")
    assert not any(path.exists() for path in left) and all(path.exists() for path in kept)


def test_a_write_that_fails_leaves_the_file_before_and_says_why_in_one_line(tmp_path):
    write_atomically(tmp_path / "file", "before")
    with pytest.raises(RuntimeError), replacing(tmp_path / "file") as partial:
        partial.write_text("half")
        raise RuntimeError
    with pytest.raises(InputError, match="cannot write .*file: No space left on device; free some space"), \
            replacing(tmp_path / "file"):
        raise OSError(28, "No space left on device")
    assert (tmp_path / "file").read_text() == "before" and os.listdir(tmp_path) == ["file"]
    with pytest.raises(InputError, match="No such file or directory; choose a folder that exists"):
        write_atomically(tmp_path / "none" / "file", "")
    with pytest.raises(InputError, match="File name too long; choose a shorter name"):
        write_atomically(tmp_path / ("x" * 256), "")
    write_atomically(tmp_path / ("ä" * 127), "a name of 254 bytes")


def begun(work, *arguments):
    """A process that is in the midst of a work, and what lets it go on."""
    entered, leave = FORK.Event(), FORK.Event()
    process = FORK.Process(target=work, args=(*arguments, entered, leave))
    process.start()
    assert entered.wait(60)
    return process, leave


def hold(folder, entered, leave):
    with alone_in(folder, wait=False):
        entered.set()
        leave.wait(60)


def test_a_folder_has_one_process_at_a_time(tmp_path):
    holder, leave = begun(hold, tmp_path / "fit")
    with pytest.raises(InputError, match=f"process {holder.pid} is at work in .*fit; try name=NAME"), \
            alone_in(tmp_path / "fit", wait=False, remedy="try name=NAME"):
        pass
    threading.Timer(0.3, leave.set).start()
    with alone_in(tmp_path / "fit", wait=True):
        assert leave.is_set(), "it waited"
        with alone_in(tmp_path / "fit", wait=False):
            pass  # a job's fit enters what the job has entered
    holder.join()


def test_a_killed_process_holds_no_folder(tmp_path):
    holder, _ = begun(hold, tmp_path)
    holder.kill()
    holder.join()
    with alone_in(tmp_path, wait=False):
        pass
