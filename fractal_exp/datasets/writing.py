"""A data set as files: a folder of PNG for each code, or WebDataset shards. What is there is whole, and is not drawn
again."""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
import re
import shutil
import tarfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import InputError
from ..rendering import png
from ..runtime import threads
from ..runtime.checks import check_count
from ..runtime.files import alone_in, make_folder, read_record, remove_partial, replacing, write_atomically
from .fractals import Fractals

RECORD = "dataset.json"
UNSAFE = re.compile(r"[^\w.-]+")
AT_A_TIME = 1024  # pictures that wait in memory, as files

Pictures = Iterable[tuple[int, bytes]]  # index and PNG
Unit = tuple[Path, Sequence[int], Callable[[Path, Pictures], None]]  # what is made, of which pictures, and how


def write(fractals: Fractals, names: Sequence[str], folder: str | Path, shards: int | None = None,
          told: Callable[[int], Any] = lambda drawn: None) -> int:
    """Write the pictures of epoch 0 into a folder, on all cores, and return how many of them were there already.

    names: of the codes. Each has a folder NUMBER-NAME of files INDEX.png. With `shards`, there are WebDataset shards of
    so many pictures in random order instead: `pictures-NUMBER.tar` with INDEX.png and INDEX.cls, the label.
    `dataset.json` keeps the options and the names. Folders and shards appear whole, so the same call goes
    on where an earlier one was interrupted, and the files are the same, byte for byte. told: is called with how many
    more pictures are done.

    Raises `InputError` if the folder holds something else, or a data set of other options, and if it cannot be
    written.
    """
    if shards is not None:
        check_count("shards", shards)
    fractals = copy.copy(fractals)
    fractals.set_epoch(0)
    digest = hashlib.blake2b(b"".join(rows.tobytes() for rows in fractals.rows), digest_size=16).hexdigest()
    record = {"program": f"fractal-exp {__version__}", **fractals.options, "shards": shards,
              "pictures": fractals.pictures, "codes": digest, "names": list(names)}
    folder = make_folder(folder)
    with alone_in(folder, wait=False, remedy="wait until it has ended, or choose another folder"):
        _check(folder, record)
        remove_partial(folder)
        write_atomically(folder / RECORD, json.dumps(record, indent=1) + "\n")
        units = list(_shards(fractals, folder, shards) if shards else _folders(fractals, names, folder))
        missing = [unit for unit in units if not unit[0].exists()]
        there = fractals.pictures - sum(len(indices) for _, indices, _ in missing)
        told(there)
        with ThreadPoolExecutor(threads.available()) as pool:
            drawn = _drawn(fractals, chain.from_iterable(indices for _, indices, _ in missing), pool, told)
            for path, indices, store in missing:
                store(path, islice(drawn, len(indices)))
    return there


def _check(folder: Path, record: dict[str, Any]) -> None:
    """Raise `InputError` unless the folder is empty or holds a part of this data set."""
    path = folder / RECORD
    if path.exists():
        old = read_record(path, "the data set", dict[str, Any])
        changed = [key for key in record if old.get(key) != record[key]]
        if changed:
            key = changed[0]
            about = "" if key in ("names", "codes") else f" ({old.get(key)} there, {record[key]} here)"
            raise InputError(f"{folder} holds a data set of other {key}{about}; repeat the options that {path} names, "
                             "or choose another folder")
    elif any(entry.name != ".lock" for entry in folder.iterdir()):
        raise InputError(f"{folder} holds other files; choose a folder that is empty or not there yet")


def _folders(fractals: Fractals, names: Sequence[str], folder: Path) -> Iterator[Unit]:
    digits, width = len(str(fractals.per_code - 1)), max(5, len(str(len(names) - 1)))
    for number, name in enumerate(names):
        first = number * fractals.per_code
        path = folder / "-".join(dict.fromkeys((f"{number:0{width}d}", UNSAFE.sub("_", name)[:100])))
        yield path, range(first, first + fractals.per_code), partial(_store_folder, first=first, digits=digits)


def _shards(fractals: Fractals, folder: Path, size: int) -> Iterator[Unit]:
    order = fractals.order()
    for number, start in enumerate(range(0, len(order), size)):
        yield (folder / f"pictures-{number:06d}.tar", order[start:start + size].tolist(),
               partial(_store_shard, per_code=fractals.per_code))


def _store_folder(path: Path, pictures: Pictures, first: int, digits: int) -> None:
    unfinished = path.with_name(f".{path.name}.unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir()
    for index, data in pictures:
        (unfinished / f"{index - first:0{digits}d}.png").write_bytes(data)
    os.replace(unfinished, path)


def _store_shard(path: Path, pictures: Pictures, per_code: int) -> None:
    with replacing(path) as unfinished, tarfile.open(unfinished, "w", format=tarfile.USTAR_FORMAT) as shard:
        for index, data in pictures:
            for suffix, content in (("png", data), ("cls", str(index // per_code).encode())):
                entry = tarfile.TarInfo(f"{index:09d}.{suffix}")
                entry.size = len(content)
                shard.addfile(entry, io.BytesIO(content))


def _drawn(fractals: Fractals, indices: Iterator[int], pool: ThreadPoolExecutor, told: Callable[[int], Any]
           ) -> Iterator[tuple[int, bytes]]:
    """The pictures in turn, drawn and compressed by the pool."""
    while some := list(islice(indices, AT_A_TIME)):
        for each in zip(some, pool.map(lambda index: png.of_dots(fractals.picture(index)), some), strict=True):
            told(1)
            yield each
