"""Files that somebody or something changed: each is read by the reader that users call, in a process of its own kind.

A reader answers with a valid value or an `InputError`, never with another exception, a crash, a hang or much memory; a
changed checkpoint never gives another content. `make test-all` tries thousands, each run of the tests a few dozen.
"""

import faulthandler
import json
import multiprocessing
import queue
import random
import re
import resource
import time
import warnings

import numpy as np
import pytest
import torch
from PIL import Image

from fractal_exp import IFS, InputError
from fractal_exp.codes import known
from fractal_exp.ifs import formats
from fractal_exp.images.reading import read_target
from fractal_exp.runtime.checkpoint import Checkpoint, Snapshot

CPU_SECONDS, SECONDS = 60, 300  # that one reading may take: of the processor's time, and asleep
MEBIBYTES = 2000  # that readings may add to the process: a changed size may come to the largest picture that is read
EXTREMES = [b"1e400", b"-1e308", b"1e39", b"NaN", b"Infinity", b"9" * 400, b"9" * 5000, b"true", b"null", b'"1"', b"[]",
            b"{}", b"-1", b"0", b"1e-320", b"4294967296", b"[" * 2000, b'{"a":1,"a":2}', b"<xform/>",
            b"<edit>" * 2000, b"&a;", b"}{", b"1 " * 20_000]
SNAPSHOT = Snapshot(7, {"raw/x": torch.arange(300.0), "step": torch.tensor(7)}, {"losses": [0.1, 1 / 3], "best": {}})
IDENTITY = {"model": {"maps": 3}, "seed": 0, "target": {"name": "fern"}}


def mutate(data, chance, textual):
    """Bytes with one to three changes: bits flipped, cut short, pieces repeated or swapped, numbers made extreme."""
    data = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 3))):
        kind = chance.choice(("bits", "cut", "repeat", "swap", "extreme"))
        if kind == "bits":
            for _ in range(chance.choice((1, 2, 8))):
                data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        elif kind == "cut":
            del data[chance.randrange(len(data)):]
        elif kind == "repeat":
            start = chance.randrange(len(data))
            piece = data[start:start + chance.randrange(1, 200)]
            data[start:start] = piece * chance.choice((1, 2, 50))
        elif kind == "swap":
            a, b = sorted(chance.randrange(len(data)) for _ in range(2))
            length = chance.randrange(1, 64)
            first, second = data[a:a + length], data[b:b + length]
            data[b:b + length], data[a:a + length] = first, second
        else:
            _make_extreme(data, chance, textual)
        data = data or bytearray(b"\0")
    return bytes(data)


def _make_extreme(data, chance, textual):
    words = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?|null|true|false", data)) if textual else []
    if words:
        start, end = chance.choice(words).span()
        data[start:end] = chance.choice(EXTREMES)
    else:  # a length or a size in a header, of either byte order
        start = chance.randrange(min(len(data), 256))
        value = chance.choice((0, 1, 0x7F, 0xFF, 0x80))
        data[start:start + chance.choice((1, 2, 4, 8))] = bytes([value]) * chance.choice((1, 2, 4, 8))


def make_codes(folder):
    """Codes in the own format, with and without probabilities, and in both public spellings."""
    fern = known("fern")
    fern.save(folder / "fern.json")
    known("levy_c_curve").save(folder / "levy.json")
    rows = [[*m.flatten().tolist(), *o.tolist(), p] for m, o, p in zip(fern.linear, fern.offset,
                                                                      fern.sampling_probabilities(), strict=True)]
    (folder / "rows.json").write_text(json.dumps([[float(x) for x in row] for row in rows]))
    (folder / "lists.json").write_text(json.dumps({"ifs_m": fern.linear.tolist(), "ifs_t": fern.offset.tolist()}))


def make_formats(folder):
    """Codes in the other formats that are read, alone and two in a file."""
    fern, levy = known("fern"), known("levy_c_curve")
    for suffix in (".csv", ".ifs", ".flame"):
        fern.save(folder / f"fern{suffix}")
    for suffix in (".ifs", ".flame"):
        formats.save([fern, levy], folder / f"both{suffix}")
    whole = (folder / "fern.flame").read_text()
    (folder / "turned.flame").write_text(whole.replace("<palette", '<symmetry kind="-3"/><palette'))
    (folder / "matrices.txt").write_text("2\n.5 .5\n2 3\n.5 0 0\n.5 0 1\n2 3\n0 .5 0\n0 .5 1\n")


def make_pictures(folder):
    """The same shape in every format that is read, some in several modes."""
    levels = np.zeros((48, 64), np.uint8)
    levels[10:40, 12:30], levels[10:20, 30:50] = 255, 128
    grey = Image.fromarray(levels)
    for name in ("grey.png", "photo.jpg", "cut.gif", "grey.bmp", "grey.tif", "grey.webp", "grey.ppm"):
        (grey.convert("RGB") if name.endswith(("webp", "jpg")) else grey).save(folder / name)
    Image.merge("RGBA", [grey] * 4).save(folder / "alpha.png")
    Image.fromarray(levels.astype(np.uint16) * 257).save(folder / "fine.png")
    grey.convert("RGB").save(folder / "packed.tif", compression="tiff_deflate")


def make_checkpoint(folder):
    Checkpoint(folder / "fit.safetensors", identity=IDENTITY).save(SNAPSHOT)


def read_code(path, name=None):  # what is wrong must be said: this runs where pytest explains no assert
    code = IFS.load(path, name)
    assert torch.isfinite(code.linear).all() and torch.isfinite(code.offset).all(), "a map of a code is not finite"
    assert code.contraction.kind in ("norm", "average"), f"a code that is read contracts by {code.contraction.kind}"
    assert isinstance(code.meta, dict), f"the notes of a code are {code.meta!r}"
    total = float(code.sampling_probabilities().sum())
    assert total == pytest.approx(1, abs=2e-3), f"the probabilities of a code sum to {total}"


def read_every_code(path):
    for name in ("#1", "#2") if path.stem == "both" else (None,):
        read_code(path, name)


def read_picture(path):
    image = read_target(path, 32).image
    assert image.shape == (32, 32), f"a target of 32² has the shape {tuple(image.shape)}"
    low, high = float(image.min()), float(image.max())
    assert 0 <= low and high <= 1, f"the levels of a target reach from {low} to {high}"


def read_checkpoint(path):
    snapshot = Checkpoint(path, identity=IDENTITY, resume=True).load()
    assert (snapshot.iteration, snapshot.numbers) == (SNAPSHOT.iteration, SNAPSHOT.numbers), "changed numbers are read"
    assert snapshot.tensors.keys() == SNAPSHOT.tensors.keys(), f"the tensors that are read are {[*snapshot.tensors]}"
    changed = [name for name, tensor in SNAPSHOT.tensors.items() if not torch.equal(snapshot.tensors[name], tensor)]
    assert not changed, f"the changed tensors {changed} are read"


KINDS = {"codes": (make_codes, read_code), "formats": (make_formats, read_every_code),
         "pictures": (make_pictures, read_picture), "checkpoints": (make_checkpoint, read_checkpoint)}
TEXTUAL = (".json", ".csv", ".txt", ".ifs", ".flame")


def campaign(counts, folder, results):
    """Read mutations of each file of each kind; puts (kind, tried, refused, failures, MiB more than before)."""
    faulthandler.enable()
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    for kind, count in counts.items():
        make, read = KINDS[kind]
        (folder / kind).mkdir()
        make(folder / kind)
        tried, refused, failures, before = 0, 0, [], None
        for path in sorted(path for path in (folder / kind).rglob("*") if path.suffix and path.name[0] != "."):
            whole = path.read_bytes()
            read(path)
            before = before or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            for i in range(count):
                path.write_bytes(mutate(whole, random.Random(f"{path.name} {i}"), path.suffix in TEXTUAL))
                tried += 1
                # Both limits hold also where Python itself would never look up.
                faulthandler.dump_traceback_later(SECONDS, exit=True)
                ends = int(time.process_time()) + CPU_SECONDS
                resource.setrlimit(resource.RLIMIT_CPU, (ends, resource.RLIM_INFINITY))
                try:
                    read(path)
                except InputError as error:
                    refused += 1
                    if "\n" in str(error) or len(str(error)) > 1000:
                        failures.append(f"{path.name} {i}: no line of a sensible length: {str(error)[:500]!r}")
                except BaseException as error:
                    failures.append(f"{path.name} {i}: {type(error).__name__}: {str(error)[:300]}")
                finally:
                    faulthandler.cancel_dump_traceback_later()
            path.write_bytes(whole)
        more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        results.put((kind, tried, refused, failures, more))


def attack(counts, folder):
    context = multiprocessing.get_context("spawn")  # a crash is seen as its exit status
    results = context.Queue()
    process = context.Process(target=campaign, args=(counts, folder, results))
    process.start()
    for _ in counts:
        while True:
            try:
                kind, tried, refused, failures, more = results.get(timeout=1)
                break
            except queue.Empty:
                assert process.is_alive(), (f"a crash, or too long for one file (status "
                                            f"{process.exitcode}): the newest below {folder}")
        print(f"{kind}: {tried} tried, {refused} refused, {tried - len(failures)} clean, {more:.0f} MiB at most")
        assert not failures, f"{len(failures)} of {tried}: {failures[:20]}"
        assert more < MEBIBYTES, f"reading {kind} took {more:.0f} MiB more"
    process.join()


def test_a_few_changed_files_are_read_or_refused(tmp_path):
    attack(dict.fromkeys(KINDS, 3), tmp_path)


@pytest.mark.slow
def test_thousands_of_changed_files_are_read_or_refused(tmp_path):
    attack({"codes": 300, "formats": 400, "pictures": 160, "checkpoints": 600}, tmp_path)
