"""What tests do with the maps of a page: by hand and by key, and what they read of it."""

import json
import time

import numpy as np
import torch
from browser_helpers import PATIENCE, Opened, settled_box

from fractal_exp import IFS, View, render
from fractal_exp.evaluation.metrics import f1

VIEW = View()
SIDE, PANEL = 600, 388  # pixels of the picture, and of what lies beside it
UNIT = SIDE / 2         # pixels to a unit of the canvas
WINDOW = SIDE + PANEL, SIDE


def with_maps(opened: Opened) -> Opened:
    opened.page.click("#do-edit")
    opened.page.wait_for_selector("#panel")
    return opened


def select(opened: Opened, number: int) -> None:
    opened.page.select_option("#which", str(number))
    opened.page.wait_for_selector(f"#handle-move[aria-label*='map {number + 1},']")


def dialog(opened: Opened, name: str) -> None:
    """Open the dialog that reads a code, or the one that writes it."""
    opened.page.locator("#picture").focus()
    opened.page.keyboard.press({"in": "o", "out": "x"}[name])
    opened.page.wait_for_selector(f"#{name}[open]")


def close(opened: Opened, name: str) -> None:
    opened.page.keyboard.press("Escape")
    opened.page.wait_for_selector(f"#{name}", state="hidden")


def exported(opened: Opened, key: str = "json") -> str:
    dialog(opened, "out")
    opened.page.select_option("#out-format", key)
    text = opened.page.input_value("#out-text")
    close(opened, "out")
    return text


def code_of(opened: Opened) -> IFS:
    return IFS.from_json(json.loads(exported(opened)))


def middle(opened: Opened, kind: str) -> tuple[float, float]:
    """Where a handle is, once it has come to rest."""
    box = settled_box(opened.page.locator(f"#handle-{kind} .plate"))
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def likeness(opened: Opened, code: IFS, view: View = VIEW, least: float = 0.0) -> float:
    """F1 of the picture that is seen, once it is drawn, and of the code's. A page takes a while until it begins to draw
    what was changed, so `least` is waited for."""
    seen = opened.drawn().picture()
    truth = render(code, view, resolution=len(seen))[None]
    end = time.monotonic() + PATIENCE / 1000
    while True:
        found = float(f1(torch.tensor(opened.drawn().picture(), dtype=torch.float32)[None], truth))
        if found >= least or time.monotonic() > end:
            return found
        opened.page.wait_for_timeout(100)


def drag(opened: Opened, kind: str, dx: float, dy: float) -> None:
    x, y = middle(opened, kind)
    mouse = opened.page.mouse
    mouse.move(x, y)
    mouse.down()
    for share in (0.3, 0.7, 1):
        mouse.move(x + share * dx, y + share * dy)
    mouse.up()


def outwards(opened: Opened, kind: str, pixels: float) -> tuple[float, float]:
    """Pixels away from the map's centre, on either side of which a handle may stand."""
    (x, y), (x0, y0) = middle(opened, kind), middle(opened, "move")
    length = np.hypot(x - x0, y - y0)
    return pixels * (x - x0) / length, pixels * (y - y0) / length


def typed(opened: Opened, name: str, text: str) -> None:
    opened.page.fill(f"#{name}", text)
    opened.page.keyboard.press("Enter")


def same(a: IFS, b: IFS) -> bool:
    return torch.equal(a.linear, b.linear) and torch.equal(a.offset, b.offset)
