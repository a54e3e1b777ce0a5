"""`python -m fractal_exp.tracking dashboard FOLDER` and `… deliver FOLDER`."""

import argparse
import sys
from pathlib import Path

from ..errors import InputError
from .dashboard import serve
from .run import deliver


def main(argv: list[str] | None = None) -> int:
    """Show the runs kept under an output folder, or deliver what a lost server did not take; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m fractal_exp.tracking", description=main.__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    show = commands.add_parser("dashboard", help="serve the runs kept under FOLDER in the browser until Ctrl-C")
    show.add_argument("folder", type=Path)
    show.add_argument("--port", type=int, default=5000)
    show.add_argument("--study", help="open this study (default: that of the newest run)")
    send = commands.add_parser("deliver", help="send what the run of FOLDER could not when its server was away")
    send.add_argument("folder", type=Path)
    args = parser.parse_args(argv)
    try:
        if args.command == "deliver":
            print(f"delivered: {' '.join(deliver(args.folder))}")
        else:
            return serve(args.folder, args.port, args.study)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
