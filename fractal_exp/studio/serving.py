"""The process of the studio: its address, its port, and how it ends."""

from __future__ import annotations

import errno
import secrets
import signal
import socket
from collections.abc import Callable
from pathlib import Path

from ..errors import InputError
from ..runtime.extras import need

HOST = "127.0.0.1"   # nobody else's machine
TOKEN_BYTES = 24


def bound(port: int) -> socket.socket:
    """A socket on a port of this machine alone, 0 for any that is free. Raises `InputError` if it is in use."""
    if not 0 <= port <= 65535:
        raise InputError(f"a port is a number from 0 to 65535, got {port}; 0 takes any that is free")
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((HOST, port))
        made.listen()
    except OSError as error:
        made.close()
        if error.errno == errno.EADDRINUSE:
            raise InputError(f"port {port} is in use, perhaps by another studio; name another one with --port, or "
                             "--port 0 for any that is free") from error
        raise InputError(f"cannot listen on port {port}: {error.strerror}; name another one with --port") from error
    return made


def serve(output: Path, port: int, opened: Callable[[str, str], None], left: Callable[[str], None]) -> None:
    """Offer the studio until Ctrl-C, SIGTERM, or the end of the terminal. opened: told the address, with its token, and
    the one with which to start a browser, once; left: see `server.application`.

    Raises `InputError` if a library is missing, the port is in use, or the folder cannot be written.
    """
    need("starlette", "uvicorn", "websockets")
    import uvicorn

    from .server import LONGEST_WORD, application

    with bound(port) as listening:
        port = listening.getsockname()[1]
        token, start = (secrets.token_urlsafe(TOKEN_BYTES) for _ in range(2))
        app = application(output, token=token, port=port, start=start, left=left)
        config = uvicorn.Config(app, ws="websockets-sansio", ws_max_size=LONGEST_WORD, access_log=False,
                                log_level="warning", lifespan="on", server_header=False, timeout_graceful_shutdown=2)
        server = uvicorn.Server(config)
        if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup has it
            signal.signal(signal.SIGHUP, lambda *_: server.handle_exit(signal.SIGINT, None))
        opened(f"http://{HOST}:{port}/{token}/", f"http://{HOST}:{port}/{start}")
        server.run(sockets=[listening])
