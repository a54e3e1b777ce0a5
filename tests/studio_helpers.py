"""A studio that is served for real in a thread of the test, and a page of it without a browser."""

from __future__ import annotations

import http.client
import io
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from fractal_exp import IFS, codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.studio.worker import Ready

TOKEN = "the-token-of-the-test"
START = "the-start-of-the-test"
PATIENCE = 90  # seconds
SIDE = 64      # pixels of a picture
COMMAND = f"""
from fractal_exp.cli import studio
from fractal_exp.studio import reading

if __name__ == "__main__":
    reading.RESOLUTION = {SIDE}
    studio.main()
"""  # which brings pictures to 64² instead of 256² for a quick search


@dataclass
class Studio:
    """Where a studio listens and writes."""

    port: int
    output: Path
    left: list[str] = field(default_factory=list)
    end: Callable[[], None] = lambda: None

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    def ask(self, method: str, path: str, body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
        """The status and the text of an answer; `headers` replace those of its own page; an empty one is left out."""
        line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        given = {"Host": self.host, "Origin": f"http://{self.host}", "Content_Length": str(len(body or b""))} | headers
        line.putrequest(method, path, skip_host=True)
        for name, text in given.items():
            if text:
                line.putheader(name.replace("_", "-"), text)
        line.endheaders()
        if body:
            line.send(body)
        answer = line.getresponse()
        return answer.status, answer.read()

    def send(self, data: bytes, name: str = "picture.png") -> tuple[int, str]:
        status, text = self.ask("POST", f"/{TOKEN}/picture?name={name}", data)
        return status, json.loads(text)["why"]

    @contextmanager
    def tab(self, token: str = TOKEN, **headers: str) -> Iterator[Tab]:
        from websockets.sync.client import connect

        given = {"Origin": f"http://{self.host}"} | headers
        with connect(f"ws://{self.host}/{token}/live", additional_headers=given, max_size=None) as socket:
            yield Tab(socket)


@dataclass
class Tab:
    """A page's line to the studio; `state` is what it was told last."""

    socket: Any
    state: dict[str, Any] = field(default_factory=dict)
    progress: list[dict[str, Any]] = field(default_factory=list)

    def do(self, act: str, **more: Any) -> None:
        self.socket.send(json.dumps({"do": act, **more}))

    def until(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The first state of which something holds, from now on."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            word = json.loads(self.socket.recv(timeout=PATIENCE))
            if word["told"] == "state":
                self.state = word
                if wanted(word):
                    return word
            elif word["told"] == "progress":
                self.progress.append(word)
            else:
                raise AssertionError(f"refused: {word['why']}")
        raise AssertionError(f"not within {PATIENCE} s; the last state: {self.state}")

    def refused(self, act: str, **more: Any) -> str:
        """Why the studio does not do something."""
        self.do(act, **more)
        return self.why()

    def why(self) -> str:
        """The next refusal."""
        while (word := json.loads(self.socket.recv(timeout=PATIENCE)))["told"] != "refused":
            pass
        return word["why"]


@contextmanager
def served(output: Path, **more: Any) -> Iterator[Studio]:
    """A studio that writes into a folder. more: what else `application` takes."""
    import uvicorn

    from fractal_exp.studio.server import LONGEST_WORD, application
    from fractal_exp.studio.serving import bound

    listening = bound(0)
    studio = Studio(listening.getsockname()[1], output)
    app = application(output, token=TOKEN, port=studio.port, start=START, left=studio.left.append, **more)
    server = uvicorn.Server(uvicorn.Config(app, ws="websockets-sansio", ws_max_size=LONGEST_WORD, log_level="error",
                                           lifespan="on", timeout_graceful_shutdown=1))
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    while not server.started:
        assert thread.is_alive()
        time.sleep(0.02)

    def end() -> None:
        server.should_exit = True
        thread.join(PATIENCE)

    studio.end = end
    yield studio
    end()


class InThread:
    """A worker without a process of its own, for tests of what a session makes of tasks."""

    def __init__(self, listen: Callable[[Any], object]) -> None:
        self.listen, self.thread = listen, None
        listen(Ready())

    def do(self, task: Any) -> None:
        self.thread = threading.Thread(target=lambda: self.listen(self.done(task)), daemon=True)
        self.thread.start()

    def done(self, task: Any) -> Any:
        """What comes of a task in the end."""
        return task.run(self.listen)

    def stop(self) -> None:
        pass

    def close(self) -> None:
        if self.thread:
            self.thread.join(PATIENCE)


def free(state: dict[str, Any]) -> bool:
    return state["task"] == ""


def judged(state: dict[str, Any]) -> bool:
    return free(state) and state["verdict"] is not None


def plain(code: IFS) -> dict[str, Any]:
    """A code as a page sends it."""
    return {name: part for name, part in code.to_json().items() if name != "meta"}


def png(image: Image.Image) -> bytes:
    image.save(buffer := io.BytesIO(), "PNG")
    return buffer.getvalue()


def picture_of(name: str) -> bytes:
    """A PNG of a known code."""
    drawn = suite.target(attractor.normalize(codes.known(name)), SIDE).numpy()
    return png(Image.fromarray(np.rint(255 * drawn).astype(np.uint8)))


def rows(of: list[list[float]]) -> dict[str, Any]:
    """A code as a page sends it, from rows a b c d e f."""
    return {"format": "fractal-exp/ifs", "version": 1, "linear": [[row[:2], row[2:4]] for row in of],
            "offset": [row[4:] for row in of]}
