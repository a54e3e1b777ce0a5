"""What the plain command lines share: a parser, and errors in one line. Nothing heavy is imported."""

from __future__ import annotations

import argparse
import os
import re
import select
import sys
from collections.abc import Callable, Mapping
from typing import NoReturn

from ..errors import InputError, did_you_mean
from ..runtime.files import explain, is_of_file
from . import interruption

CODE_HELP = ("a code: a file (.json, .csv, .ifs, .flame), FILE:NAME or FILE:#2 in one with several, the name of a "
             "classic (fern, sierpinski_triangle, …), suite:INDEX or suite:INDEX:SEED")
FRAMES = ("canvas", "own")
ORDER_HELP = ("columns of a file's rows of numbers, such as abecdf, for x' = a x + b y + e, y' = c x + d y + f and the "
              "probability p (default: abcdefp, or what a first line names)")
LARGEST = 16_384  # pixels a side of a drawing
STDOUT = 1


def parse_size(text: str | None, default: int | None = None, most: int = LARGEST) -> tuple[int, int]:
    """The (height, width) in pixels that --size asks for, or a square of `default`."""
    found = re.fullmatch(r"([0-9]+)(?:[x×]([0-9]+))?", str(default) if text is None else text, re.IGNORECASE)
    sides = [side for side in found.groups() if side] if found else []
    if not sides or any(len(side) > len(str(most)) or not 1 <= int(side) <= most for side in sides):
        raise InputError(f"--size must be from 1 to {most} pixels a side, such as 1024, or 1920x1080 (width x "
                         f"height), got {text!r:.100}")
    return int(sides[-1]), int(sides[0])


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
    parser._negative_number_matcher = re.compile(r"-(\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?$", re.IGNORECASE)
    return parser


def command(program: str, work: Callable[[argparse.Namespace], None], parser: argparse.ArgumentParser,
            arguments: list[str] | None) -> None:
    """Parse, work, and print what a user can mend as one line (exit status 2)."""
    try:
        with interruption.not_lost():
            work(parser.parse_intermixed_args(arguments))
    except KeyboardInterrupt:
        print(f"\n{program}: interrupted", file=sys.stderr)
        raise SystemExit(130) from None
    except Exception as error:
        if isinstance(error, BrokenPipeError) and _nobody_reads():
            raise SystemExit(141) from None
        line = told(error)
        if line is None:
            raise
        complain(program, line)


def refuse_idle(options: argparse.Namespace, idle: Mapping[str, str],
                default: Callable[[str], object] = lambda name: None) -> None:
    """Raise `InputError` on an option that was given and would change nothing. idle: such options by name, and why in
    words; default: what an option is if it was not given."""
    for name, why in idle.items():
        if getattr(options, name) != default(name):
            raise InputError(f"--{name.replace('_', '-')} {why}; leave it out")


def _nobody_reads() -> bool:
    """Whether the output is a pipe that its reader has closed, as `head` does. What is left of it is dropped."""
    if not hasattr(select, "poll"):  # on Windows
        return True
    pipe = select.poll()
    pipe.register(STDOUT, select.POLLERR)
    if not pipe.poll(0):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), STDOUT)
    return True


def told(error: Exception) -> str | None:
    """What a user can mend, in one line: what was given, what the system refuses of a file, a fit that broke down."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, OSError):
        return explain(error) if is_of_file(error) else None
    from ..methods.base import FitDiverged

    return str(error) if isinstance(error, FitDiverged) else None


def complain(program: str, message: object) -> NoReturn:
    """Print an error as one line, whatever names are in it, and end with status 2."""
    tell(f"{program}: error: {message}")
    raise SystemExit(2) from None


def tell(message: str) -> None:
    """Print a message beside the answer, as one line, whatever names are in it."""
    print(printable(message), file=sys.stderr)


def printable(text: str) -> str:
    """A text in one line, with line breaks and control characters as Python writes them: names may hold any."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)
