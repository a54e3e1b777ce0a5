"""What the site does beyond mkdocs's plugins: formulas become MathML, and parameter classes become tables.

A formula is written $…$ or $$…$$, and \\tag{3} numbers it. MathML needs no script and no font, so a page loads nothing
for it.

A line `[parameters: package.module.Class]`, with a prefix for the names if one follows after a space, becomes the
table of the fields of that class. The class is a pydantic model or a dataclass; a field that holds another such class
becomes a table of its own.
"""

from __future__ import annotations

import ast
import html
import inspect
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from importlib import import_module
from types import NoneType
from typing import Any, Literal, get_args, get_origin

INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
DISPLAY = re.compile(r'<div class="arithmatex">\\\[(.*?)\\\]</div>', re.DOTALL)
TOGETHER = re.compile(r"(<math[^>]*>(?:(?!</math>).)*</math>[.,;:)]+)", re.DOTALL)
TAG = re.compile(r"\\tag\{(\w+)\}")
PARAMETERS = re.compile(r"^\[parameters: ([\w.]+)\.(\w+)(?: ([\w.]+))?\]$", re.MULTILINE)
HEAD = "| name | default | range | unit | meaning |\n|---|---|---|---|---|\n"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put tables in the place of lines that ask for them."""
    return PARAMETERS.sub(lambda found: parameter_tables(getattr(import_module(found[1]), found[2]), found[3] or ""),
                          markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Turn formulas into MathML."""
    content = TOGETHER.sub(r'<span class="together">\1</span>', INLINE.sub(lambda found: _mathml(found[1], "inline"),
                                                                           content))
    return DISPLAY.sub(_display, content)


def _display(found: re.Match) -> str:
    latex = found[1]
    number = TAG.search(latex)
    label = f'<span class="number">({number[1]})</span>' if number else ""
    return f'<div class="equation">{_mathml(TAG.sub("", latex), "block")}{label}</div>'


def _mathml(latex: str, display: str) -> str:
    from latex2mathml.converter import convert

    return convert(html.unescape(latex).strip(), display=display)


@dataclass(frozen=True)
class Row:
    """A field of a parameter class, in words."""

    name: str
    default: str
    range: str
    unit: str
    meaning: str

    def __str__(self) -> str:
        cells = (f"`{self.name}`", self.default, self.range, self.unit, self.meaning)
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def parameter_tables(owner: type, prefix: str = "") -> str:
    """Markdown tables of a parameter class: its own fields, then those of every class that a field holds.

    Raises `ValueError` for a field that nothing documents, since a table without its meaning helps nobody.
    """
    fields, rows, parts = _fields(owner), [], []
    for name, field in fields.items():
        dotted = f"{prefix}.{name}" if prefix else name
        inner = _parameter_class(field.annotation)
        if inner is not None:
            parts.append(f"\n**`{dotted}`**: {_summary(inner)}\n\n{parameter_tables(inner, dotted)}")
        else:
            rows.append(_row(owner, dotted, name, field))
    table = HEAD + "".join(f"{row}\n" for row in rows) if rows else ""
    return table + "".join(parts)


def _fields(owner: type) -> dict[str, Any]:
    """Pydantic's field descriptions of a model or a dataclass, by name."""
    from pydantic.dataclasses import dataclass as validated

    if hasattr(owner, "model_fields"):
        return owner.model_fields
    return getattr(owner, "__pydantic_fields__", None) or validated(owner).__pydantic_fields__


def _parameter_class(annotation: Any) -> type | None:
    """The parameter class that a field holds, also where it may hold none."""
    candidates = (annotation, *get_args(annotation))
    return next((each for each in candidates if isinstance(each, type)
                 and (is_dataclass(each) or hasattr(each, "model_fields"))), None)


def _row(owner: type, dotted: str, name: str, field: Any) -> Row:
    meaning = field.description or _docstrings(owner).get(name)
    if not meaning:
        raise ValueError(f"{owner.__name__}.{name} has no description and no docstring")
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    return Row(dotted, _default(field), _range(field), str(extra.get("unit", "")), " ".join(meaning.split()))


def _default(field: Any) -> str:
    if field.is_required():
        return "required"
    return f"`{field.get_default(call_default_factory=True)!r}`"


def _range(field: Any) -> str:
    """The bounds of a number, or the values that a field may take."""
    choices = list(_choices(field.annotation))
    signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
    bounds = [f"{sign} {getattr(limit, key):g}" for key, sign in signs.items() for limit in field.metadata
              if getattr(limit, key, None) is not None]
    return ", ".join(([" and ".join(bounds)] if bounds else []) + choices)


def _choices(annotation: Any) -> Iterator[str]:
    if annotation is bool:
        yield "true, false"
    elif annotation is NoneType:
        yield "none"
    elif get_origin(annotation) is Literal:
        yield from (f"`{choice}`" for choice in get_args(annotation))
    else:
        for inner in get_args(annotation):
            yield from _choices(inner)


def _summary(owner: type) -> str:
    """The first paragraph of a class's own docstring; a dataclass without one has its signature there."""
    text = owner.__dict__.get("__doc__") or ""
    if not text or text.startswith(f"{owner.__name__}("):
        raise ValueError(f"{owner.__name__} has no docstring")
    return " ".join(inspect.cleandoc(text).split("\n\n")[0].split())


def _docstrings(owner: type) -> dict[str, str]:
    """The strings that follow the fields in the source of a class, those of its bases included."""
    found: dict[str, str] = {}
    for base in reversed([each for each in owner.__mro__ if hasattr(each, "__annotations__")]):
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0].body
        except (OSError, TypeError):  # no source: a built-in or a generated class
            continue
        for field, text in zip(body, body[1:], strict=False):
            if (isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr)
                    and isinstance(text.value, ast.Constant) and isinstance(text.value.value, str)):
                found[field.target.id] = text.value.value
    return found
