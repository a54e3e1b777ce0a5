"""What the plain command lines share: naming codes, and errors in one line."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from .. import codes
from ..errors import InputError, did_you_mean
from ..ifs import attractor, formats
from ..ifs.code import IFS
from ..runtime.files import explain, is_of_file
from ..suite import SUITE_SEED, random_suite
from . import interruption

CODE_HELP = ("a code: a file (.json, .ifs, .flame), FILE:NAME or FILE:#2 in one with several, the name of a classic "
             "(fern, sierpinski_triangle, …), suite:INDEX or suite:INDEX:SEED")
FRAMES = {"canvas": attractor.normalize, "own": lambda code: code}


class Raw(argparse.ArgumentDefaultsHelpFormatter, argparse.RawDescriptionHelpFormatter):
    """Help that keeps the lines of the description and shows defaults."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        quiet = action.default is None or action.default is False
        return action.help if quiet else super()._get_help_string(action)


class _Parser(argparse.ArgumentParser):
    """An argument parser whose errors are `InputError`, with what an unknown word may have meant."""

    def error(self, message: str) -> NoReturn:
        found = re.search(r"unrecognized arguments: (\S+)", message)
        raise InputError(f"{message}{self._hint(found[1]) if found else ''}")

    def _hint(self, word: str) -> str:
        name = word.split("=")[0]
        if name.startswith("-"):
            return did_you_mean(name, [flag for flag in self._option_string_actions if flag.startswith("--")])
        return f"; write --set {word}" if name != word and "--set" in self._option_string_actions else ""


def command_parser(program: str, description: str) -> argparse.ArgumentParser:
    """An argument parser that knows -1.5e-6 for a number, which Python's own takes for an option until 3.14."""
    parser = _Parser(program, description=description, formatter_class=Raw)
    parser._negative_number_matcher = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$", re.IGNORECASE)
    return parser


def read_code(text: str) -> IFS:
    """The code that a command line names. Raises `InputError` if there is none."""
    if text.startswith("suite:"):
        index, seed = suite_address(text)
        return random_suite(index + 1, seed)[index]
    path, name = _file_and_name(text)
    if path.is_dir() and (path / "code.json").is_file():
        path = path / "code.json"
    if _may_be_file(path):
        return IFS.load(path, name)
    if text in codes.names():
        return codes.known(text)
    near = did_you_mean(text, codes.names())
    raise InputError(f"{text!r} is no file and no classic code{near or ';'} give {CODE_HELP.removeprefix('a code: ')}")


def _file_and_name(text: str) -> tuple[Path, str | None]:
    """FILE:NAME as its parts; a file that is there, or a suffix, decides which colon it is."""
    if not os.path.exists(text):
        for colon in (i for i, letter in enumerate(text) if letter == ":"):
            if _may_be_file(Path(text[:colon])):
                return Path(text[:colon]), text[colon + 1:]
    return Path(text), None


def _may_be_file(path: Path) -> bool:
    return os.path.exists(path) or path.suffix.lower() in formats.suffixes()


def suite_address(text: str) -> tuple[int, int]:
    """Index and seed of suite:INDEX or suite:INDEX:SEED."""
    parts = text.split(":")[1:]
    if len(parts) not in (1, 2) or not all(part.isdigit() for part in parts):
        raise InputError(f"a fractal of the suite is named suite:INDEX or suite:INDEX:SEED, got {text!r}")
    return int(parts[0]), int(parts[1]) if len(parts) == 2 else SUITE_SEED


def make_folder(path: str | Path) -> Path:
    """The absolute folder, made if need be. Raises `InputError` if it cannot be."""
    folder = Path(path).absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {explain(error, folder)}") from error
    return folder


def command(program: str, work: Callable[[argparse.Namespace], None], parser: argparse.ArgumentParser,
            arguments: list[str] | None) -> None:
    """Parse, work, and print what a user can mend as one line (exit status 2), what the disk refuses included."""
    try:
        with interruption.not_lost():
            work(parser.parse_intermixed_args(arguments))
    except InputError as error:
        print(f"{program}: error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except OSError as error:
        if not is_of_file(error):
            raise
        print(f"{program}: error: {explain(error)}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print(f"\n{program}: interrupted", file=sys.stderr)
        raise SystemExit(130) from None
