"""The studio's page, its WebSocket and its uploads, for whoever knows the token and comes from the page itself."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from functools import cache, partial
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from ..errors import InputError
from ..viewer.page import fragments
from .session import Session

LARGEST_UPLOAD = 64 * 2**20   # bytes
LONGEST_WORD = 2**20          # characters of a message from a page
MOST_TABS = 16
NAMES = "127.0.0.1", "localhost"
KINDS = {".mjs": "text/javascript", ".css": "text/css"}
FOLDERS = "fractal_exp.studio", "fractal_exp.viewer"   # whose static files the page loads
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
                               "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff", "referrer-policy": "no-referrer", "cache-control": "no-store",
    "cross-origin-resource-policy": "same-origin", "cross-origin-opener-policy": "same-origin",
}

log = logging.getLogger(__name__)


class Guard:
    """Lets through what names this server as its host, comes from its own page and knows the token, which is the first
    part of every path. Another site cannot do the first two, nor another user of the machine the third."""

    def __init__(self, app: ASGIApp, *, token: str, port: int):
        self.app, self.token = app, token
        self.hosts = {f"{name}:{port}" for name in NAMES}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        refusal = self.refusal(HTTPConnection(scope), scope)
        if refusal is None:
            return await self.app(scope, receive, partial(_with_headers, send))
        if scope["type"] == "websocket":
            return await send({"type": "websocket.close", "code": 1008, "reason": refusal})
        await PlainTextResponse(refusal + "\n", 403, HEADERS)(scope, receive, send)

    def refusal(self, asked: HTTPConnection, scope: Scope) -> str | None:
        """Why nothing is answered, in words; None where all is well."""
        host, origin = asked.headers.get("host", ""), asked.headers.get("origin")
        if host not in self.hosts:
            return "The studio answers only to its own address on this machine, such as 127.0.0.1"
        changes = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if origin != f"http://{host}" and (changes or origin is not None):
            return "The studio takes nothing from another page than its own"
        token = scope["path"].split("/")[1]
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            return "This address lacks the studio's token, or has a wrong one; open the one that fractal-studio printed"
        return None


async def _with_headers(send: Send, message: Message) -> None:
    if message["type"] == "http.response.start":
        message["headers"] = [*message["headers"], *((name.encode(), text.encode()) for name, text in HEADERS.items())]
    await send(message)


def application(output: Path, *, token: str, port: int, kept: Callable[[Path], None] = lambda _: None) -> ASGIApp:
    """The ASGI application of one session. output: the only folder that it writes into; kept: told the file of a code
    that nobody had saved when the application ended."""

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        app.state.session = session = Session(output, asyncio.get_running_loop())
        try:
            yield
        finally:
            if (path := await asyncio.to_thread(session.close)) is not None:
                kept(path)

    routes = [
        Route("/{token}/", _page), Route("/{token}/static/{name}", _static),
        Route("/{token}/picture", _upload, methods=["POST"]), Route("/{token}/{which}.png", _image),
        WebSocketRoute("/{token}/live", _live),
    ]
    return Guard(Starlette(routes=routes, lifespan=lifespan), token=token, port=port)


@cache
def studio_page() -> str:
    """The studio's HTML, with the panel and the dialogs of the viewer's editor. What it loads lies under static/."""
    text = (resources.files("fractal_exp.studio") / "static" / "studio.html").read_text("utf-8")
    return Template(text).substitute(fragments())


async def _page(_: Request) -> Response:
    return Response(studio_page(), media_type="text/html")


async def _static(request: Request) -> Response:
    name = request.path_params["name"]
    kind = KINDS.get(Path(name).suffix)
    for folder in FOLDERS if kind else ():
        files = {file.name: file for file in (resources.files(folder) / "static").iterdir()}
        if name in files:
            return Response(files[name].read_bytes(), media_type=kind)
    return PlainTextResponse("there is no such file\n", 404)


async def _image(request: Request) -> Response:
    session: Session = request.app.state.session
    picture, which = session.picture, request.path_params["which"]
    if picture is None or which not in ("target", "given"):
        return PlainTextResponse("there is no such picture\n", 404)
    make = picture.target_png if which == "target" else picture.given_png
    try:
        return Response(await asyncio.to_thread(make), media_type="image/png")
    except InputError as error:  # another one took its place meanwhile
        return PlainTextResponse(f"{error}\n", 404)


async def _upload(request: Request) -> Response:
    """A picture as the body of a request, read no further than a picture may be large."""
    session: Session = request.app.state.session
    data = bytearray()
    told = request.headers.get("content-length", "0")
    too_large = told.isdigit() and int(told) > LARGEST_UPLOAD
    if not too_large:
        async for part in request.stream():
            data += part
            if too_large := len(data) > LARGEST_UPLOAD:
                break
    if too_large:
        return JSONResponse({"why": f"a picture may have {LARGEST_UPLOAD // 2**20} MiB at most; make it smaller"}, 413,
                            {"connection": "close"})
    try:
        await session.take(bytes(data), request.query_params.get("name", ""))
    except InputError as error:
        return JSONResponse({"why": str(error)}, 400)
    return JSONResponse({"why": ""})


async def _live(socket: WebSocket) -> None:
    """All that a page is told, and all that it asks for. Every page follows the one session."""
    session: Session = socket.app.state.session
    await socket.accept()
    if len(session.listeners) >= MOST_TABS:
        return await socket.close(1013, f"{MOST_TABS} pages follow this session already; close one of them")
    words: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
    hear = words.put_nowait
    session.listeners.add(hear)
    words.put_nowait(session.facts())
    telling = asyncio.create_task(_tell(socket, words))
    try:
        while True:
            why = await _done(session, await socket.receive_text())
            if why:
                words.put_nowait({"told": "refused", "why": why})
    except (WebSocketDisconnect, KeyError):  # KeyError: bytes in place of text
        pass
    finally:
        session.listeners.discard(hear)
        telling.cancel()


async def _tell(socket: WebSocket, words: asyncio.Queue[dict[str, Any]]) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # it went away while it was told
        while True:
            await socket.send_text(json.dumps(await words.get(), allow_nan=False))


async def _done(session: Session, text: str) -> str:
    """Do what a page asks for; why it could not be done, empty if it was."""
    try:
        word = json.loads(text) if len(text) <= LONGEST_WORD else None
    except (ValueError, RecursionError) as error:
        return f"the page sent what cannot be read ({type(error).__name__}); load it again"
    asked: dict[str, Any] = word if isinstance(word, dict) else {}
    name = asked.get("do")
    try:
        if not isinstance(name, str) or name not in ACTS:
            raise InputError(f"the studio knows {', '.join(ACTS)}, got {str(name)[:40]!r}; load the page again")
        doing = ACTS[name](session, asked)
        if doing is not None:
            await doing
    except InputError as error:
        return str(error)
    except OSError as error:
        log.exception("the disk refused what a page asked for")
        return f"the disk refused: {error.strerror}"
    except Exception as error:
        log.exception("a defect of the studio")
        return f"the studio has a defect ({type(error).__name__}: {error}); its log has the details"
    return ""


def _mapping(asked: Mapping[str, Any], name: str) -> dict[str, Any]:
    given = asked.get(name) or {}
    if not isinstance(given, dict):
        raise InputError(f"{name} must be a mapping, got {type(given).__name__}; load the page again")
    return given


ACTS: dict[str, Callable[[Session, Mapping[str, Any]], Awaitable[None] | None]] = {
    "read": lambda session, asked: session.read(_mapping(asked, "reading")),
    "find": lambda session, asked: session.find(_mapping(asked, "settings")),
    "stop": lambda session, asked: session.stop(),
    "go_on": lambda session, asked: session.go_on(),
    "polish": lambda session, asked: session.polish(_mapping(asked, "settings")),
    "edit": lambda session, asked: session.edit(asked.get("code")),
    "choose": lambda session, asked: session.choose(asked.get("index")),
    "save": lambda session, asked: session.save(),
}
