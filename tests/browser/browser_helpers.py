"""Debian's Chromium on one processor without a GPU, and a page that is opened in it."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

CHROMIUM = "/usr/bin/chromium"
QUIET = ["--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync"]
SOFTWARE = [*QUIET, "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 60_000  # ms
COARSE = {"device_scale_factor": 0.25}  # a sixteenth of the points, for tests that look at what is around the picture


@dataclass
class Opened:
    """A page in the browser, with all that it says on the console and asks of anybody."""

    page: object
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.on("console", lambda message: self._hear(f"{message.type}: {message.text}"))
        self.page.on("pageerror", lambda error: self.said.append(f"error: {error}"))
        self.page.on("request", lambda request: self.asked.append(request.url))

    def _hear(self, said: str) -> None:
        if "GL Driver Message (OpenGL, Performance" not in said:  # the browser's own copy of a canvas without a GPU
            self.said.append(said)

    def go(self, url: str) -> Opened:
        self.page.goto(url)
        return self.drawn()

    def drawn(self, frame: object = None) -> Opened:
        """Wait until the picture is done; the page's policy lets no test run a script of its own there."""
        (frame or self.page).wait_for_selector('html[data-state="done"]', state="attached", timeout=PATIENCE)
        return self

    def redrawn(self, act: Callable[[], object]) -> Opened:
        """Do something that changes the picture, and wait until that is done. It may be before anybody looks."""
        self.page.evaluate("document.documentElement.dataset.state = 'before'")
        act()
        self.page.wait_for_selector('html:not([data-state="before"])', state="attached", timeout=PATIENCE)
        return self.drawn()

    def picture(self) -> np.ndarray:
        """What is seen, (H,W) in [0,1], as the page itself saves it."""
        return self._saved("L") / 255

    def colours(self) -> np.ndarray:
        """The same in colour, (H,W,3), 0 to 255."""
        return self._saved("RGB").astype(float)

    def _saved(self, mode: str) -> np.ndarray:
        with self.page.expect_download() as download:
            self.page.keyboard.press("s")
        return np.asarray(Image.open(io.BytesIO(Path(download.value.path()).read_bytes())).convert(mode))

    def text(self, name: str) -> str:
        return self.page.inner_text(f"#{name}")


def settled_box(element: object) -> dict[str, float]:
    """Where an element lies once it has come to rest. On a busy machine it may still move after it has appeared."""
    before, box = None, element.bounding_box()
    while box is None or box != before:
        element.page.wait_for_timeout(200)
        before, box = box, element.bounding_box()
    return box


class Pages:
    """The pages of a browser, taken again once a test has done with them: to open one takes a second of a core."""

    def __init__(self, browser: object) -> None:
        self.browser, self.idle = browser, {}

    @contextmanager
    def lent(self) -> Iterator[Callable[..., Opened]]:
        """Opens pages, each with settings of its own, and puts them back in the end."""
        taken = []

        def opened(side: int | tuple[int, int] = 128, scheme: str = "dark", **settings: object) -> Opened:
            width, height = (side, side) if isinstance(side, int) else side
            key = scheme, *sorted(settings.items())
            page = (self.idle[key].pop() if self.idle.get(key) else
                    self.browser.new_context(color_scheme=scheme, **settings).new_page())
            taken.append((key, page))
            page.emulate_media(color_scheme=scheme)
            page.set_viewport_size({"width": width, "height": height})
            return Opened(page)

        yield opened
        for key, page in taken:
            page.goto("about:blank")
            self.idle.setdefault(key, []).append(page)
