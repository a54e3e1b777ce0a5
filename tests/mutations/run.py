"""Make small mistakes in a copy of the tree, one at a time, and see whether the tests notice.

python tests/mutations/run.py [--only PART …] [--jobs N] [--record FILE]

Each entry of mutations.toml is one mistake. The copy lies in the temporary folder and stays there between calls, so
that numba's cache serves again; the working tree is only read. First the tests named must pass in the copy as it is.
Exit status: 0 if all mistakes are caught, 1 if one survives, 2 if nothing could be learnt.
"""

from __future__ import annotations

import argparse
import fcntl
import hashlib
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIST = Path(__file__).with_name("mutations.toml")
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "outputs", "multirun", ".pytest_cache", ".ruff_cache", "*.egg-info")
PYTEST = "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"
SECONDS = 600  # for the tests of one mutation; one that never ends has been noticed


class Broken(Exception):
    """Something is wrong with the list, the copy or a test: nothing can be said about the tests."""


@dataclass(frozen=True)
class Mutation:
    """`old` stands exactly once in `file` and is replaced by `new`; one of `tests` (files or node ids) must fail."""

    name: str
    file: str
    old: str
    new: str
    tests: list[str]

    def applied(self, root: Path = ROOT) -> str:
        """The file's text with the mistake. Raises `Broken` unless the old text stands in it exactly once."""
        text = (root / self.file).read_text()
        if (found := text.count(self.old)) != 1:
            raise Broken(f"{self.name}: its old text must stand exactly once in {self.file}, found {found} times; "
                         f"correct {LIST.name}")
        return text.replace(self.old, self.new)


def load() -> list[Mutation]:
    """All mutations of the list. Raises `TypeError` on an entry with other keys."""
    return [Mutation(**entry) for entry in tomllib.loads(LIST.read_text())["mutation"]]


class Copy:
    """A copy of the tree, with everything that numba has compiled there. What a killed call left behind is mended."""

    def __init__(self, number: int):
        name = f"mutations-{hashlib.sha256(str(ROOT).encode()).hexdigest()[:8]}-{os.getuid()}-{number}"
        self.root = Path(tempfile.gettempdir()) / name
        self.environment = os.environ | {"PYTHONPATH": str(self.root), "PYTHONDONTWRITEBYTECODE": "1"}
        self._lock = open(f"{self.root}.lock", "w")  # held as long as this process lives
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise Broken(f"another run.py is at work in {self.root}; wait until it is done") from error
        for place in self._files(self.root) - self._files(ROOT):
            (self.root / place).unlink()  # deleted in the tree since
        shutil.copytree(ROOT, self.root, ignore=LEFT_OUT, copy_function=_copy_if_changed, dirs_exist_ok=True)
        where = self._run("-c", "import fractal_exp; print(fractal_exp.__file__)").stdout.strip()
        if Path(where) != self.root / "fractal_exp" / "__init__.py":
            raise Broken(f"Python imports {where or 'nothing'} instead of the copy in {self.root}")

    @staticmethod
    def _files(root: Path) -> set[Path]:
        return {path.relative_to(root) for part in ("fractal_exp", "tests", "conf", "sweeps")
                for path in (root / part).rglob("*") if path.is_file() and path.parent.name != "__pycache__"}

    def _run(self, *arguments: str, seconds: float | None = None) -> subprocess.CompletedProcess:
        return subprocess.run([sys.executable, *arguments], cwd=self.root, env=self.environment, text=True,
                              timeout=seconds, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def check(self, tests: list[str]) -> None:
        """Raise `Broken` unless the tests pass."""
        done = self._run(*PYTEST, *tests)
        if done.returncode:
            raise Broken(f"the tests fail without any mutation:\n{done.stdout[-4000:]}")

    def notices(self, mutation: Mutation) -> bool:
        """Whether one of the mutation's tests fails. Raises `Broken` where they do not even run."""
        with self._mutated(mutation):
            try:
                done = self._run(*PYTEST, *mutation.tests, seconds=SECONDS)
            except subprocess.TimeoutExpired:
                return True
        if done.returncode not in (0, 1):  # pytest's own statuses: passed, failed
            raise Broken(f"{mutation.name}: pytest ended with status {done.returncode}:\n{done.stdout[-4000:]}")
        return done.returncode == 1

    @contextmanager
    def _mutated(self, mutation: Mutation) -> Iterator[None]:
        """The mistake in its file, for a while; then file, time stamps and compiled kernels are as they were."""
        path, text = self.root / mutation.file, mutation.applied(self.root)
        compiled = path.parent / "__pycache__"
        with tempfile.TemporaryDirectory(dir=self.root) as aside:
            kept = [path, *compiled.glob(f"{path.stem}.*.nb?")]
            for file in kept:
                shutil.move(file, aside)
            try:
                path.write_text(text)
                yield
            finally:
                for file in compiled.glob(f"{path.stem}.*.nb?"):
                    file.unlink()
                for file in kept:
                    shutil.move(Path(aside) / file.name, file)


def _copy_if_changed(source: str, target: str) -> None:
    """Copy a file with its time stamp, by which numba knows its kernels; the copy's own kernels stay."""
    if os.path.exists(target):
        a, b = os.stat(source), os.stat(target)
        if (a.st_mtime_ns, a.st_size) == (b.st_mtime_ns, b.st_size) or target.endswith((".nbi", ".nbc")):
            return
    shutil.copy2(source, target)


def record(path: Path, noticed: dict[str, bool]) -> None:
    """Add the outcome, by name of the mutation, to a file of JSON lines, as benchmarks do."""
    sys.path.insert(0, str(ROOT))
    from benchmarks.record import append

    caught, survived = sum(noticed.values()), [name for name, was_caught in noticed.items() if not was_caught]
    append(path, "mutations", {"caught": caught, "survived": survived},
           {"share of mutations caught": caught / len(noticed)})


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[""], metavar="PART", help="those with this in their names")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="copies that are worked on at once")
    parser.add_argument("--record", type=Path, metavar="FILE",
                        help="add the outcome of the whole list to this file of JSON lines")
    options = parser.parse_args()
    if options.record and options.only != [""]:
        parser.error("--record is for the whole list, but --only chooses some; leave one of them out")
    chosen = [mutation for mutation in load() if any(part in mutation.name for part in options.only)]
    if not chosen:
        parser.error(f"no mutation's name holds {' or '.join(options.only)}")
    for mutation in chosen:
        mutation.applied()

    copies: queue.SimpleQueue[Copy] = queue.SimpleQueue()
    for number in range(min(options.jobs, len(chosen))):
        copy = Copy(number)
        copies.put(copy)
    copy.check(sorted({test for mutation in chosen for test in mutation.tests}))

    def caught(mutation: Mutation) -> bool:
        copy, start = copies.get(), time.monotonic()
        try:
            noticed = copy.notices(mutation)
        finally:
            copies.put(copy)
        print(f"{'caught  ' if noticed else 'SURVIVED'} {time.monotonic() - start:5.0f} s  {mutation.name}", flush=True)
        return noticed

    with ThreadPoolExecutor(options.jobs) as pool:
        noticed = dict(zip((mutation.name for mutation in chosen), pool.map(caught, chosen), strict=True))
    print(f"{sum(noticed.values())} of {len(noticed)} mutations caught")
    if options.record:
        record(options.record, noticed)
    return int(not all(noticed.values()))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Broken as problem:
        print(f"run.py: error: {problem}", file=sys.stderr)
        sys.exit(2)
