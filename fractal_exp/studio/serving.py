"""The process of the studio: its address, its port, and how it ends."""

from __future__ import annotations

import errno
import secrets
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


def serve(output: Path, port: int, opened: Callable[[str], None], kept: Callable[[Path], None]) -> None:
    """Offer the studio until Ctrl-C. opened: told the address, with its token; kept: see `server.application`.

    Raises `InputError` if a library is missing or the port is in use.
    """
    need("starlette", "uvicorn", "websockets")
    import uvicorn

    from .server import LONGEST_WORD, application

    listening = bound(port)
    port, token = listening.getsockname()[1], secrets.token_urlsafe(TOKEN_BYTES)
    app = application(output, token=token, port=port, kept=kept)
    config = uvicorn.Config(app, ws="websockets-sansio", ws_max_size=LONGEST_WORD, access_log=False,
                            log_level="warning", lifespan="on", server_header=False, timeout_graceful_shutdown=2)
    opened(f"http://{HOST}:{port}/{token}/")
    uvicorn.Server(config).run(sockets=[listening])
