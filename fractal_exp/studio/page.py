"""The studio's page: its own HTML, with the panel and the dialogs of the viewer's editor."""

from __future__ import annotations

from functools import cache
from importlib import resources
from string import Template

from ..viewer.page import fragments


@cache
def studio_page() -> str:
    """The HTML. What it loads lies beside it, under static/."""
    text = (resources.files("fractal_exp.studio") / "static" / "studio.html").read_text("utf-8")
    return Template(text).substitute(fragments())
