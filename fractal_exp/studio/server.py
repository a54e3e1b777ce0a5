"""The studio's page, its WebSocket and its uploads, for whoever knows the token and comes from the page itself."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import secrets
import time
from collections.abc import AsyncIterator, Callable
from functools import cache, partial
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from ..errors import InputError
from ..viewer.page import fragments
from .keeping import Folder
from .messages import understood
from .session import Session
from .worker import Listener, Worker

LARGEST_UPLOAD = 64 * 2**20   # bytes
LONGEST_WORD = 2**20          # characters of a message from a page
UPLOAD_SECONDS = 120           # that a picture may take to come
MOST_TABS = 16
MOST_WORDS = 1000              # that wait for a page
START_SECONDS = 300            # that a browser may take to start
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
    part of every path. Another site cannot do the first two, nor another user of the machine the third.

    start: a path that leads to the page once, within `START_SECONDS`. A browser is started with it, as other users of
    the machine see the arguments of every process. No cookie takes the token's place: browsers send those of 127.0.0.1
    to every port, so to the servers of other users too.
    """

    def __init__(self, app: ASGIApp, *, token: str, port: int, start: str):
        self.app, self.token, self.start = app, token, start
        self.hosts = {f"{name}:{port}" for name in NAMES}
        self.until = time.monotonic() + START_SECONDS

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        refusal = self.refusal(HTTPConnection(scope), scope)
        if refusal is None and self.starts(scope):
            self.until = -math.inf
            return await RedirectResponse(f"/{self.token}/", 303, HEADERS)(scope, receive, send)
        if refusal is None and not _same(scope["path"].split("/")[1:2], self.token):
            refusal = ("This address lacks the studio's token, has a wrong one, or was used already; open the one that "
                       "fractal-studio printed")
        if refusal is None:
            return await self.app(scope, receive, partial(_with_headers, send))
        if scope["type"] == "websocket":
            return await send({"type": "websocket.close", "code": 1008, "reason": refusal})
        await PlainTextResponse(refusal + "\n", 403, HEADERS)(scope, receive, send)

    def refusal(self, asked: HTTPConnection, scope: Scope) -> str | None:
        """Why nothing is answered, in words, whatever the path; None where all is well."""
        host, origin = asked.headers.get("host", ""), asked.headers.get("origin")
        if host not in self.hosts:
            return "The studio answers only to its own address on this machine, such as 127.0.0.1"
        changes = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if origin != f"http://{host}" and (changes or origin is not None):
            return "The studio takes nothing from another page than its own"
        return None

    def starts(self, scope: Scope) -> bool:
        """Whether the first request comes to the address with which the browser was started."""
        return (scope["type"] == "http" and scope["method"] == "GET" and time.monotonic() < self.until
                and _same(scope["path"].split("/")[1:], self.start))


def _same(parts: list[str], secret: str) -> bool:
    """Whether the parts of a path (none of `*`) are the secret; the time that it takes tells nothing."""
    return bool(secret) and secrets.compare_digest("/".join(parts).encode(), secret.encode())


async def _with_headers(send: Send, message: Message) -> None:
    if message["type"] == "http.response.start":
        message["headers"] = [*message["headers"], *((name.encode(), text.encode()) for name, text in HEADERS.items())]
    await send(message)


def application(output: Path, *, token: str, port: int, start: str = "", left: Callable[[str], None] = lambda _: None,
                worker: Callable[[Listener], Worker] = Worker) -> ASGIApp:
    """The ASGI application of one session. output: the only folder that it writes into; start: see `Guard`; left: told
    in words what became of a code that nobody had saved when the application ended; worker: see `Session`. Raises
    `InputError` if the folder cannot be written."""
    folder = Folder.new(output)

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        app.state.session = session = Session(folder, output, asyncio.get_running_loop(), worker)
        app.state.taking = asyncio.Lock()
        try:
            yield
        finally:
            if words := await session.close():
                left(words)

    routes = [
        Route("/{token}/", _page), Route("/{token}/static/{name}", _static), Route("/{token}/saved/{name}", _saved),
        Route("/{token}/picture", _upload, methods=["POST"]), Route("/{token}/{which}.png", _image),
        WebSocketRoute("/{token}/live", _live),
    ]
    return Guard(Starlette(routes=routes, lifespan=lifespan), token=token, port=port, start=start)


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


async def _saved(request: Request) -> Response:
    """A file of the code that is saved, for the browser to put where it puts files; it is never shown as a page."""
    session: Session = request.app.state.session
    name = request.path_params["name"]
    if name not in session.saved.get("names", ()):
        return PlainTextResponse("there is no such file\n", 404)
    return FileResponse(Path(session.saved["folder"]) / name, filename=name)


async def _image(request: Request) -> Response:
    session: Session = request.app.state.session
    make = session.image(request.path_params["which"])
    if make is None:
        return PlainTextResponse("there is no such picture\n", 404)
    try:
        async with session.reading:
            png = await asyncio.to_thread(make)
    except InputError as error:  # another one took its place meanwhile
        return PlainTextResponse(f"{error}\n", 404)
    return Response(png, media_type="image/png")


async def _upload(request: Request) -> Response:
    """A picture as the body of a request, read no further than a picture may be large, and one at a time."""
    taking: asyncio.Lock = request.app.state.taking
    if taking.locked():
        return _refused("another picture is on its way; wait a moment", 409)
    async with taking:
        try:
            async with asyncio.timeout(UPLOAD_SECONDS):
                data = await _body(request)
        except (ClientDisconnect, TimeoutError):
            return _refused("the picture did not come whole; send it again", 408)
        if data is None:
            return _refused(f"a picture may have {LARGEST_UPLOAD // 2**20} MiB at most; make it smaller", 413)
        try:
            await request.app.state.session.take(data, request.query_params.get("name", ""))
        except InputError as error:
            return _refused(str(error), 400)
    return JSONResponse({"why": ""})


def _refused(why: str, status: int) -> Response:
    return JSONResponse({"why": why}, status, {"connection": "close"} if status != 400 else None)


async def _body(request: Request) -> bytes | None:
    """The body of a request, or None if it is too large."""
    told, data = request.headers.get("content-length", "0"), bytearray()
    if told.isdigit() and int(told) > LARGEST_UPLOAD:
        return None
    async for part in request.stream():
        data += part
        if len(data) > LARGEST_UPLOAD:
            return None
    return bytes(data)


async def _live(socket: WebSocket) -> None:
    """All that a page is told, and all that it asks for. Every page follows the one session."""
    session: Session = socket.app.state.session
    with contextlib.suppress(WebSocketDisconnect, OSError, RuntimeError):  # it went away while it was told
        await socket.accept()
        if len(session.listeners) >= MOST_TABS:
            return await socket.close(1013, f"{MOST_TABS} pages follow this session already; close one of them")
        words: asyncio.Queue[dict[str, Any]] = asyncio.Queue(MOST_WORDS)
        words.put_nowait(session.facts())
        async with asyncio.TaskGroup() as both:
            hearing = both.create_task(_hear(socket, session, words))
            telling = both.create_task(_tell(socket, words))

            def hear(word: dict[str, Any]) -> None:
                try:
                    words.put_nowait(word)
                except asyncio.QueueFull:  # a page that sleeps: when it wakes it asks anew
                    hearing.cancel()

            session.listeners.add(hear)
            hearing.add_done_callback(lambda _: (session.listeners.discard(hear), telling.cancel()))


async def _hear(socket: WebSocket, session: Session, words: asyncio.Queue[dict[str, Any]]) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, KeyError):  # KeyError: bytes in place of text
        while True:
            why = await _done(session, await socket.receive_text())
            if why:
                await words.put({"told": "refused", "why": why})


async def _tell(socket: WebSocket, words: asyncio.Queue[dict[str, Any]]) -> None:
    with contextlib.suppress(WebSocketDisconnect, OSError, RuntimeError):  # it went away while it was told
        while True:
            await socket.send_text(json.dumps(await words.get(), allow_nan=False))


async def _done(session: Session, text: str) -> str:
    """Do what a page asks for; why it could not be done, empty if it was."""
    try:
        doing = understood(text).carry_out(session)
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
