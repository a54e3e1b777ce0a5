"""Files that appear whole or not at all, folders with one user at a time, and small JSON files read with care."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import re
import reprlib
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

from filelock import FileLock, Timeout

from ..errors import InputError

LARGEST_JSON = 16 * 2**20  # bytes; read, they may take twenty times as much memory
MOST_DIGITS = 308          # of a whole number, so that it is also a floating-point number
ABANDONED_AFTER = 3600.0   # seconds without a write: then the process that wrote a partial file is gone
PARTIAL = re.compile(r"\..+\.[0-9a-f]{12}\.partial(\.\w+)?", re.DOTALL)
POLL_SECONDS = 0.2         # between two looks at a folder's lock

REMEDIES = {
    errno.ENOSPC: "free some space, or choose another disk",
    errno.EDQUOT: "your quota is used up: free some space, or choose another disk",
    errno.EFBIG: "files may not be so large here: raise the limit (ulimit -f), or choose another disk",
    errno.ENAMETOOLONG: "choose a shorter name",
}


def explain(error: OSError, path: str | Path | None = None) -> str:
    """What the system said about a file (`path`, where the error itself names none), and the remedy; one line."""
    where = path if path is not None else error.filename
    return (f"{f'{where}: ' if where is not None else ''}{error.strerror or error}; "
            f"{REMEDIES.get(error.errno or 0, 'choose a folder that exists and may be written')}")


def make_folder(path: str | Path) -> Path:
    """The absolute folder, made if need be. Raises `InputError` if it cannot be."""
    folder = Path(path).absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {explain(error, folder)}") from error
    return folder


@contextlib.contextmanager
def replacing(path: str | Path, suffix: str = ".partial") -> Iterator[Path]:
    """A new, empty file beside `path`, which takes its place when the block ends without an error, else vanishes.

    At any moment `path` is a whole file, the old one or the new, even if the power fails. Any number of threads and
    processes may write one path: the last to finish wins. What killed processes left in a folder is removed an hour
    later, by the next process that writes into it. suffix: how the new file's name ends, for writers that go by it.
    Raises `InputError` where the file cannot be written; what the system says of other files, or of a pipe or a
    connection, passes as it is.
    """
    path = Path(path).absolute()
    if "\0" in str(path):
        raise InputError(f"no file's name can hold the character 0, as {str(path)!r} does; choose another")
    # A name may have 255 bytes, and a character four.
    partial = path.with_name(f".{path.name[:40]}.{secrets.token_hex(6)}{suffix}")
    try:
        try:
            open(partial, "xb").close()
            _remove_abandoned(path.parent, partial.stat().st_mtime)
            yield partial
            with open(partial, "rb") as file:
                os.fsync(file.fileno())
            os.replace(partial, path)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        if not is_of_file(error) or error.filename not in (None, str(partial), str(path)):
            raise
        raise InputError(f"cannot write {explain(error, path)}") from error


def is_of_file(error: OSError) -> bool:
    """Whether the system said it about a file: not so of a closed pipe, a lost connection or a library's own words."""
    return error.errno is not None and not isinstance(error, ConnectionError)  # BrokenPipeError is one of these


_looked_through: set[Path] = set()  # folders; to list one at every write would take ever longer as it fills


def _remove_abandoned(folder: Path, now: float) -> None:
    """Remove what killed processes left in a folder, once a process. now: by the clock of the disk, which may be
    another machine's."""
    if folder in _looked_through:
        return
    _looked_through.add(folder)
    remove_partial(folder, now - ABANDONED_AFTER)


def remove_partial(folder: Path, before: float = math.inf) -> None:
    """Remove the partial files of a folder, or only those that were last written before a time."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:  # which may be closed to us
        for entry in entries:
            if PARTIAL.fullmatch(entry.name):
                with contextlib.suppress(OSError):  # another process was quicker, or it belongs to somebody else
                    if entry.stat().st_mtime < before:
                        os.unlink(entry.path)


def write_atomically(path: str | Path, data: bytes | str) -> None:
    """Write a whole file or none, text as UTF-8; see `replacing`."""
    with replacing(path) as partial:
        partial.write_bytes(data.encode() if isinstance(data, str) else data)


@contextlib.contextmanager
def alone_in(folder: str | Path, *, wait: bool, remedy: str = "wait until it has ended") -> Iterator[None]:
    """Make the folder if need be, and be the only process at work in it; a thread may enter again what it has entered.

    The lock is the kernel's, so it goes with its process, however that ends. wait: for another process to leave;
    otherwise raises `InputError` at once, which names that process and the `remedy`.
    """
    folder = Path(folder).absolute()
    path = folder / ".lock"
    lock = FileLock(path, is_singleton=True, poll_interval=POLL_SECONDS)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire(timeout=-1 if wait else 0)
        path.write_text(str(os.getpid()))  # for whoever wants to know
    except Timeout:
        raise InputError(f"{_holder(path)} is at work in {folder}; {remedy}") from None
    except OSError as error:
        lock.release()
        raise InputError(f"cannot write {explain(error, path)}") from error
    try:
        yield
    finally:
        lock.release()


def _holder(lock: Path) -> str:
    try:
        return f"process {int(lock.read_text())}"
    except (OSError, ValueError):  # it has not noted its number yet
        return "another process"


def check_file(path: str | Path, what: str, most_bytes: int | None = None) -> Path:
    """The absolute path of an ordinary file of at most `most_bytes`. Raises `InputError` that names it as `what`.

    What is no ordinary file (a folder, a pipe, a device) is not opened: to read from it could wait for ever.
    """
    path = Path(path).absolute()
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot read {what} {path}: {reason}; check the path") from error
    if not stat.S_ISREG(status.st_mode):
        kind = next((name for test, name in ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"),
                                             (stat.S_ISSOCK, "a socket")) if test(status.st_mode)), "a device")
        raise InputError(f"cannot read {what} {path}: it is {kind}; give the path of a file")
    if most_bytes is not None and status.st_size > most_bytes:
        raise InputError(f"cannot read {what} {path}: it has {status.st_size} bytes, at most {most_bytes} are read")
    return path


def read_json(path: str | Path, what: str) -> Any:
    """The plain data of a JSON file (UTF-8) of at most 16 MiB, which gives no key twice. Raises `InputError`."""
    return parse_json(read_file(path, what, LARGEST_JSON), str(Path(path).absolute()))


def read_file(path: str | Path, what: str, most_bytes: int | None = None) -> bytes:
    """The bytes of an ordinary file; see `check_file`."""
    path = check_file(path, what, most_bytes)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {what} {path}: {error.strerror}") from error


def parse_json(data: bytes, name: str) -> Any:
    """The plain data of JSON (UTF-8), at most 16 MiB, that gives no key twice and has no whole number beyond the
    floating-point numbers. Raises `InputError`, which begins with the name."""
    if len(data) > LARGEST_JSON:
        raise InputError(f"{name} has {len(data)} bytes, at most {LARGEST_JSON} are read")
    try:
        return json.loads(data.decode(), object_pairs_hook=_no_key_twice, parse_int=_whole_number)
    except RecursionError:
        raise InputError(f"{name} is no JSON that can be read: its lists are nested too deeply") from None
    except InputError as error:
        raise InputError(f"{name} {error}") from None
    except ValueError as error:
        raise InputError(f"{name} is not JSON: {error}") from error


def _no_key_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) < len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # `add` gives None
        raise InputError(f"gives the key {reprlib.repr(twice)} twice, and nobody knows which is meant; drop one")
    return data


def _whole_number(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise InputError(f"has a number of {len(digits)} digits, at most {MOST_DIGITS} are read; correct it")
    return int(digits)


T = TypeVar("T")


def checked(data: Any, schema: type[T], name: str, remedy: str, *, finite: bool = True) -> T:
    """Plain data that a program wrote, read and refused as by `parse_record`. finite: refuse other numbers, too."""
    try:
        text = json.dumps(data, allow_nan=not finite)
    except (ValueError, RecursionError):
        raise InputError(f"{name} is damaged: it has a number that is not finite, or is nested too deeply; "
                         f"{remedy}") from None
    return parse_record(text, schema, name, remedy)


def read_record(path: str | Path, what: str, schema: type[T], remedy: str = "delete it",
                most_bytes: int = LARGEST_JSON) -> T:
    """A JSON file that a program wrote; see `parse_record`."""
    return parse_record(read_file(path, what, most_bytes), schema, str(path), remedy)


def parse_record(data: bytes | str, schema: type[T], name: str, remedy: str) -> T:
    """JSON that a program wrote, as the type (pydantic's or a dataclass) that says what may be in it; other keys of an
    object are left out.

    Raises `InputError` on anything else: one line with the name, the place, what is wrong with it, and the remedy.
    """
    from pydantic import TypeAdapter, ValidationError  # a command answers --help without it

    try:
        return TypeAdapter(schema).validate_json(data, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "all of it"
        raise InputError(f"{name} is damaged: {reprlib.repr(place)}: {first['msg'][:200]}; {remedy}") from None
