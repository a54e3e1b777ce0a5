"""What the site does beyond mkdocs's plugins: formulas become MathML, and parameter classes become tables.

A formula is written $…$ or $$…$$, and \\tag{3} numbers it. MathML needs no script and no font, so a page loads nothing
for it.

A line `[parameters: package.module.Class]`, with a prefix for the names if one follows after a space, becomes the
table of the fields of that class. The class is a pydantic model or a dataclass; a field that holds another such class
becomes a table of its own.

A line `[table: MAKER FILE ...]` becomes a table of results: see `docs/tables.py`.

Every code in docs/codes becomes a page to fly through, and a link `[code](codes/NAME.json)` gets one to it.
"""

from __future__ import annotations

import ast
import html
import inspect
import json
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass, replace
from importlib import import_module
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
DISPLAY = re.compile(r'<div class="arithmatex">\\\[(.*?)\\\]</div>', re.DOTALL)
TOGETHER = re.compile(r"(<math[^>]*>(?:(?!</math>).)*</math>[.,;:)]+)", re.DOTALL)
TAG = re.compile(r"\\tag\{(\w+)\}")
CODE = re.compile(r"\[code\]\((codes/\w+)\.json\)")
TABLE = re.compile(r"^\[table: (\w+)((?: [\w./-]+)*)\]$", re.MULTILINE)
PARAMETERS = re.compile(r"^\[parameters: ([\w.]+)\.(\w+)(?: ([\w.]+))?\]$", re.MULTILINE)

SIGNS = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
SPACE = "\N{NO-BREAK SPACE}"
REQUIRED = object()


def on_files(files: Any, *, config: Any) -> Any:
    """Add a page for every code."""
    from mkdocs.structure.files import File

    for path in sorted(Path(config.docs_dir, "codes").glob("*.json")):
        files.append(File.generated(config, f"codes/{path.stem}.html", content=code_page(path)))
    return files


def code_page(path: Path) -> str:
    """The HTML of a code's page, on the whole attractor, titled as the classic code of the file's name is."""
    from fractal_exp import IFS, codes
    from fractal_exp.viewer.page import page

    code = IFS.load(path)
    title = codes.known(path.stem).meta.get("title") if path.stem in codes.names() else None
    return page(replace(code, meta={"title": title or path.stem, "name": path.stem}))


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put tables in the place of lines that ask for them, and links to pages beside those to codes."""
    from docs.tables import table

    markdown = TABLE.sub(lambda found: table(found[1], *found[2].split()), markdown)
    markdown = CODE.sub(r"[code](\1.json), [fly through it](\1.html)", markdown)
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


def parameter_tables(owner: type, prefix: str = "", default: Any = None) -> str:
    """Markdown tables of a parameter class: its own fields, then those of every component.

    default: the instance whose values are the defaults, that of the class itself if none is given. Components of one
    class share a table. Raises `ValueError` for what nothing documents, since a table without its meaning helps nobody.
    """
    rows, components = [], {}
    for name, field in _fields(owner).items():
        value = getattr(default, name) if default is not None else _default(field)
        entry = Entry(f"{prefix}.{name}" if prefix else name, value, field, _meaning(owner, name, field))
        inner = _parameter_class(field.annotation)
        if inner is None:
            rows.append(entry)
        else:
            components.setdefault(inner, []).append(entry)
    parts = [_table(rows)] if rows else []
    for inner, entries in components.items():
        parts += [_component(inner, entries[0])] if len(entries) == 1 else [_shared_table(inner, entries)]
    return "\n\n".join(parts)


@dataclass(frozen=True)
class Entry:
    """A field of a parameter class: its full name, default and meaning; `field` is pydantic's description."""

    name: str
    default: Any
    field: Any
    meaning: str

    @property
    def unit(self) -> str:
        """What the field's `json_schema_extra` calls its unit."""
        extra = self.field.json_schema_extra
        return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def _table(entries: list[Entry]) -> str:
    units = any(entry.unit for entry in entries)
    head = ["name", "default", "range", *(["unit"] if units else []), "meaning"]
    return _markdown(head, [[f"`{entry.name}`", _shown(entry.default), _range(entry.field),
                             *([entry.unit] if units else []), _documented(entry.name, entry.meaning)]
                            for entry in entries])


def _component(inner: type, entry: Entry) -> str:
    about = entry.meaning or _summary(inner)
    return f"**`{entry.name}`**: {about}\n\n{parameter_tables(inner, entry.name, entry.default)}"


def _shared_table(inner: type, entries: list[Entry]) -> str:
    """One row for each component of a class, one column for each of its fields."""
    fields = _fields(inner)
    columns = [f"`{name}`: {_documented(f'{inner.__name__}.{name}', _meaning(inner, name, field))}"
               + (f" ({bounds})" if (bounds := _range(field)) else "") for name, field in fields.items()]
    rows = [[f"`{entry.name}`", *(_shown(getattr(entry.default, name)) for name in fields),
             _documented(entry.name, entry.meaning)] for entry in entries]
    return (f"**{_summary(inner)}** Each of these has\n\n" + "".join(f"- {column}\n" for column in columns) + "\n"
            + _markdown(["name", *(f"`.{name}`" for name in fields), "of"], rows))


def _markdown(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


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


def _meaning(owner: type, name: str, field: Any) -> str:
    return " ".join((field.description or _docstrings(owner).get(name, "")).split())


def _documented(name: str, meaning: str) -> str:
    if not meaning:
        raise ValueError(f"{name} has no description and no docstring")
    return meaning


def _default(field: Any) -> Any:
    return REQUIRED if field.is_required() else field.get_default(call_default_factory=True)


def _shown(value: Any) -> str:
    """A value as the command line takes it."""
    if value is REQUIRED:
        return "required"
    if isinstance(value, float):
        return f"`{value:g}`"
    return f"`{value if isinstance(value, str) else json.dumps(value)}`"


def _range(field: Any) -> str:
    """The bounds of a number, or the values that a field may take."""
    bounds, choices = _bounds(field.metadata), list(_choices(field.annotation))
    return ", ".join(([bounds] if bounds else []) + choices)


def _bounds(metadata: Any) -> str:
    found = {key: f"{getattr(limit, key):g}" for limit in metadata for key in SIGNS
             if getattr(limit, key, None) is not None}
    if found.keys() == {"ge", "le"}:
        return f"{found['ge']} … {found['le']}"
    return ", ".join(f"{sign}{SPACE}{found[key]}" for key, sign in SIGNS.items() if key in found)


def _choices(annotation: Any) -> Iterator[str]:
    if annotation is bool:
        yield "true, false"
    elif annotation is NoneType:
        yield "null"
    elif get_origin(annotation) is Literal:
        yield from (f"`{choice}`" for choice in get_args(annotation))
    elif get_origin(annotation) is Annotated:
        inner, *notes = get_args(annotation)
        bounds = _bounds(limit for note in notes for limit in getattr(note, "metadata", [note]))
        yield from ([bounds] if bounds else [])
        yield from _choices(inner)
    elif get_origin(annotation) is tuple:
        yield from (f"each {found}" for found in dict.fromkeys(", ".join(_choices(inner))
                                                               for inner in get_args(annotation)) if found)
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
