"""`fractal-studio`: find the code of a picture while one looks on. A plain command line: the page does the rest."""

from __future__ import annotations

import argparse
import contextlib
import sys
import webbrowser
from pathlib import Path

from ..runtime import threads
from ..runtime.files import make_folder
from .commands import command, command_parser

DESCRIPTION = """Offer the studio: a page into which a picture is dropped, and which shows how its code is found.

The page is offered to this machine alone (127.0.0.1), at an address that holds a random token. Nothing is written but
into --output. Ctrl-C ends the studio; what was not saved is kept there, and offered at the next start.

examples
  fractal-studio
  fractal-studio --port 0 --no-browser     any free port; open the address that is printed"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-studio`. arguments: those of the process if None."""
    parser = command_parser("fractal-studio", DESCRIPTION)
    parser.add_argument("--port", type=int, default=8421, help="of this machine; 0: any that is free")
    parser.add_argument("--output", metavar="FOLDER", default="outputs/studio", help="that codes are saved in")
    parser.add_argument("--no-browser", action="store_true", help="open no browser, only print the address")
    command("fractal-studio", offer, parser, arguments)


def offer(options: argparse.Namespace) -> None:
    """Do what the command line asks for."""
    from ..studio.serving import serve

    threads.use(1)  # the search has a process of its own

    def opened(address: str, start: str) -> None:
        print(f"  studio     {address}\n  written to {folder}\n  Ctrl-C ends it", flush=True)
        if not options.no_browser:
            webbrowser.open(start)  # other users of the machine see a browser's arguments, and never the token

    def left(words: str) -> None:
        with contextlib.suppress(OSError):  # the terminal was closed
            print(f"  {words}", file=sys.stderr)

    folder = make_folder(Path(options.output))
    serve(folder, options.port, opened, left)
