"""Make small mistakes in a copy of the tree, one at a time, and see whether the tests notice.

python tests/mutations/run.py [--only PART …] [--record FILE]

Each entry of mutations.toml is one mistake; the working tree is only read. First the tests named must pass in the copy
as it is. Exit status: 0 if all mistakes are caught, 1 if one survives, 2 if nothing could be learnt.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIST = Path(__file__).with_name("mutations.toml")
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "build", "outputs", "multirun", ".*_cache", "*.egg-info")
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
    """A copy of the tree with its compiled kernels, which numba knows by the time stamps of their files."""

    def __init__(self, root: Path):
        shutil.copytree(ROOT, root, ignore=LEFT_OUT)
        self.root = root
        self.environment = os.environ | {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
        where = self._run("-c", "import fractal_exp; print(fractal_exp.__file__)").stdout.strip()
        if Path(where) != root / "fractal_exp" / "__init__.py":
            raise Broken(f"Python imports {where or 'nothing'} instead of the copy in {root}")

    def _run(self, *arguments: str, seconds: float | None = None) -> subprocess.CompletedProcess:
        return subprocess.run([sys.executable, *arguments], cwd=self.root, env=self.environment, text=True,
                              timeout=seconds, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def fails(self, tests: list[str], seconds: float | None = None) -> bool:
        """Whether one of these tests fails. Raises `Broken` where they do not even run."""
        try:
            done = self._run("-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests, seconds=seconds)
        except subprocess.TimeoutExpired:
            return True
        if done.returncode not in (0, 1):  # pytest's own statuses: passed, failed
            raise Broken(f"pytest ended with status {done.returncode}:\n{done.stdout[-4000:]}")
        return done.returncode == 1

    def notices(self, mutation: Mutation) -> bool:
        """Whether one of the mutation's tests fails; then the file, its time stamp and its kernels are as before."""
        path, text = self.root / mutation.file, mutation.applied(self.root)
        with tempfile.TemporaryDirectory(dir=self.root) as aside:
            kernels = path.parent / "__pycache__", f"{path.stem}.*.nb?"
            kept = [path, *kernels[0].glob(kernels[1])]
            for file in kept:
                shutil.move(file, aside)
            path.write_text(text)
            try:
                return self.fails(mutation.tests, SECONDS)
            finally:
                for file in kernels[0].glob(kernels[1]):
                    file.unlink()
                for file in kept:
                    shutil.move(Path(aside) / file.name, file)


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
    parser.add_argument("--record", type=Path, metavar="FILE",
                        help="add the outcome of the whole list to this file of JSON lines")
    options = parser.parse_args()
    if options.record and options.only != [""]:
        parser.error("--record is for the whole list, but --only chooses some; leave one of them out")
    chosen = [mutation for mutation in load() if any(part in mutation.name for part in options.only)]
    if not chosen:
        parser.error(f"no mutation's name holds {' or '.join(options.only)}")

    noticed = {}
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        copy = Copy(Path(folder).resolve() / "tree")
        if copy.fails(sorted({test for mutation in chosen for test in mutation.tests})):
            raise Broken("the tests fail without any mutation")
        for mutation in chosen:
            start = time.monotonic()
            noticed[mutation.name] = copy.notices(mutation)
            print(f"{'caught  ' if noticed[mutation.name] else 'SURVIVED'} {time.monotonic() - start:5.0f} s  "
                  f"{mutation.name}", flush=True)
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
