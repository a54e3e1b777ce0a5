"""Chromium, driven by Playwright, and what is opened in it; what is missing is the reason to skip."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator

import pytest
from browser_helpers import CHROMIUM, COARSE, SOFTWARE, Opened, Pages
from editing_helpers import WINDOW, with_maps

from fractal_exp import codes
from fractal_exp.ifs import attractor


@pytest.fixture(scope="session")
def playwright() -> Iterator[object]:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if not shutil.which(CHROMIUM):
        pytest.skip(f"there is no {CHROMIUM}; tests/browser/install.sh installs it")
    with sync_api.sync_playwright() as playwright:
        yield playwright


@pytest.fixture(scope="session")
def browser(playwright: object) -> Iterator[object]:
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE, env=dict(os.environ))
    yield browser
    browser.close()


@pytest.fixture(scope="session")
def pages(browser: object) -> Pages:
    return Pages(browser)


@pytest.fixture
def open_page(pages: Pages) -> Iterator[Callable[..., Opened]]:
    with pages.lent() as opened:
        yield opened


@pytest.fixture(scope="module")
def fern(tmp_path_factory):
    """The fern's code on the canvas, and its page."""
    code = attractor.normalize(codes.known("fern"))
    return code, code.save_html(tmp_path_factory.mktemp("page") / "fern.html")


@pytest.fixture
def editing(fern, open_page):
    """Opens the fern's page with its maps shown."""
    def opened(side=WINDOW, fragment="", **settings) -> Opened:
        return with_maps(open_page(side, **COARSE | settings).go(f"file://{fern[1]}{fragment}"))

    return opened
