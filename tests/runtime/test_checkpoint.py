import multiprocessing
import os
import signal
import time

import pytest
import torch

from fractal_exp import InputError
from fractal_exp.runtime.checkpoint import Checkpoint, Snapshot

SNAPSHOT = Snapshot(7, {"raw/x": torch.arange(3.0), "adam/step": torch.tensor(7.0)}, {"losses": [0.1, 1 / 3]})


def test_a_snapshot_comes_back_bit_for_bit(tmp_path):
    checkpoint = Checkpoint(tmp_path / "fit.safetensors", identity={"model": {"maps": 3}}, resume=True)
    assert checkpoint.load() is None
    checkpoint.save(SNAPSHOT)
    back = checkpoint.load()
    assert back.iteration == 7 and back.numbers == SNAPSHOT.numbers
    assert all(torch.equal(back.tensors[name], SNAPSHOT.tensors[name]) for name in SNAPSHOT.tensors)
    assert Checkpoint(checkpoint.path, resume=False).load() is None
    assert os.listdir(tmp_path) == ["fit.safetensors"]


def test_another_configuration_is_refused_by_name(tmp_path):
    Checkpoint(tmp_path / "f", identity={"model": {"maps": 3}, "seed": 0}).save(SNAPSHOT)
    other = Checkpoint(tmp_path / "f", identity={"model": {"maps": 10}, "seed": 0, "new": 1}, resume=True)
    with pytest.raises(InputError, match="another configuration: model.maps: 3 there, 10 now; new: 'absent' there"):
        other.load()


@pytest.mark.parametrize("content", [b"", b"nonsense", b"\xff" * 100])
def test_a_damaged_file_is_refused(tmp_path, content):
    (tmp_path / "f").write_bytes(content)
    with pytest.raises(InputError, match="cannot read the checkpoint .* delete it to start afresh"):
        Checkpoint(tmp_path / "f", resume=True).load()


def _save_for_ever(path):
    checkpoint, i = Checkpoint(path), 0
    while True:
        # Small tensors: torch's thread pool does not survive a fork.
        checkpoint.save(Snapshot(i, {f"x{k}": torch.full((10_000,), float(i)) for k in range(20)}))
        i += 1


def test_a_kill_in_the_middle_of_saving_leaves_a_whole_file(tmp_path):
    context = multiprocessing.get_context("fork")
    for attempt in range(5):
        process = context.Process(target=_save_for_ever, args=(tmp_path / "f",))
        process.start()
        deadline = time.monotonic() + 20
        while not (tmp_path / "f").exists() and time.monotonic() < deadline:
            time.sleep(0.005)
        time.sleep(0.01 * attempt)
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        snapshot = Checkpoint(tmp_path / "f", resume=True).load()
        assert len(snapshot.tensors) == 20
        assert all(bool((tensor == snapshot.iteration).all()) for tensor in snapshot.tensors.values())


def test_no_changed_byte_is_accepted(tmp_path):
    path = tmp_path / "f"
    Checkpoint(path).save(SNAPSHOT)
    data = path.read_bytes()
    for place in range(len(data)):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1:])
        with pytest.raises(InputError, match="cannot read the checkpoint .* delete it to start afresh"):
            Checkpoint(path, resume=True).load()
