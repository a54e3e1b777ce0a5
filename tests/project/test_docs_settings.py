"""The numbers on the pages of the method are those of the code.

A page quotes a setting or a constant as `name=value`, or as `component.name=value` where several have the name and
different values. A setting is a field of a parameter class. Any other name is a constant of a module, in capitals
there, or a field of a class with a default; the component is then the name of the module's file, or of the class.
"""

import ast
import importlib
import math
import operator
import re
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from pathlib import Path

import pytest
from places import ROOT

import fractal_exp
from fractal_exp.methods.collage.params import CollageParams

PAGES = [ROOT / "docs" / f"{name}.md" for name in ("method", "cameras", "growth")]
PACKAGE = Path(fractal_exp.__file__).parent
CONSTANTS = ["cameras", "methods/collage", "ops/collage", "ops/histogram", "ifs/affine.py", "ifs/attractor.py",
             "ifs/code.py", "images/levels.py", "verdict.py", "likeness.py"]   # where constants are sought
QUOTED = re.compile(r"`([a-z]\w*(?:\.[a-z]\w*)*) ?= ?((?:[-(\[\d]|true|false|null)[^`]*)`")
FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
WORDS = {"true": True, "false": False, "null": None, "pi": math.pi}
ARITHMETIC = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
              ast.Pow: operator.pow}


def pairs(text):
    """(name, value as written) of every setting that a page quotes."""
    return QUOTED.findall(FENCED.sub("", text))


def value_of(text):
    """The value that a page states: numbers, words, lists of them, and arithmetic."""
    def evaluate(node):
        match node:
            case ast.Constant():
                return node.value
            case ast.Name():
                return WORDS.get(node.id, node.id)
            case ast.UnaryOp(op=ast.USub()):
                return -evaluate(node.operand)
            case ast.BinOp():
                return ARITHMETIC[type(node.op)](evaluate(node.left), evaluate(node.right))
            case ast.Tuple() | ast.List():
                return tuple(inner for each in node.elts for inner in (
                    evaluate(each.value) if isinstance(each, ast.Starred) else [evaluate(each)]))
            case ast.Call(func=ast.Name(id="range")):
                return tuple(range(*map(evaluate, node.args)))
        raise ValueError(f"{text} is no value")
    return evaluate(ast.parse(text, mode="eval").body)


def plain(value):
    """A value of the code as numbers, words and tuples. A descent is its steps, its rate and a limit of its own."""
    if hasattr(value, "steps") and hasattr(value, "rate"):
        own = [value.largest] if value.largest != type(value)(1).largest else []
        return value.steps, value.rate, *own
    if isinstance(value, (list, tuple, range)):
        return tuple(map(plain, value))
    if hasattr(type(value), "model_fields"):
        return tuple(plain(getattr(value, name)) for name in type(value).model_fields)
    return tuple(plain(getattr(value, each.name)) for each in fields(value)) if is_dataclass(value) else value


def same(stated, value):
    if isinstance(stated, tuple):
        return isinstance(value, tuple) and len(stated) == len(value) and all(map(same, stated, value))
    if isinstance(stated, float) or isinstance(value, float):
        return isinstance(value, (int, float)) and math.isclose(stated, value, rel_tol=1e-9)
    return type(stated) is type(value) and stated == value


def settings(params, prefix=""):
    """(full name, value) of the fields of a parameter class, and of those of its components."""
    for name in type(params).model_fields:
        value = getattr(params, name)
        yield prefix + name, value
        if hasattr(type(value), "model_fields"):
            yield from settings(value, f"{prefix}{name}.")


@cache
def every_setting():
    """All settings of the method."""
    return [*settings(CollageParams())]


@cache
def sources():
    """The dotted name and the text of every module that may hold a constant."""
    paths = [path for folder in CONSTANTS for path in sorted(PACKAGE.glob(folder))]
    files = [file for path in paths for file in ([path] if path.is_file() else sorted(path.rglob("*.py")))]
    return {".".join(("fractal_exp", *file.relative_to(PACKAGE).with_suffix("").parts)): file.read_text()
            for file in files}


def constants(name):
    """(module or class, value) of every constant of this name, and of every default of a class's field."""
    capital, field = re.compile(rf"^(?:\w+, )*{name.upper()}\b[^=\n]*= ", re.M), re.compile(rf"^    {name}: .*= ", re.M)
    for module, text in sources().items():
        if capital.search(text):
            yield module, getattr(importlib.import_module(module), name.upper())
        if field.search(text):
            for owner in vars(importlib.import_module(module)).values():
                if isinstance(owner, type) and is_dataclass(owner) and owner.__module__ == module:
                    yield from ((f"{module}.{owner.__name__}", each.default) for each in fields(owner)
                                if each.name == name and each.default is not MISSING)


def meanings(name):
    """The values that a name may stand for: of settings, else of constants. A component before the name is that of a
    setting, a constant that has the name as a field, or the module or class of a constant."""
    component, _, last = name.rpartition(".")
    found = [value for full, value in every_setting() if full == name or not component and full.endswith(f".{name}")]
    if found and component:
        return found
    owners = [owner for _, owner in constants(component)] if component.isidentifier() else []
    if held := [getattr(owner, last) for owner in owners if hasattr(owner, last)]:
        return held
    return found + [value for place, value in constants(last)
                    if not component or f".{place.lower()}".endswith(f".{component}")]


def mistakes(text):
    """What a page quotes that the code has not."""
    wrong = []
    for name, stated in pairs(text):
        known = [plain(value) for value in meanings(name)]
        if not known or not all(same(value_of(stated), value) for value in known):
            wrong.append(f"{name} = {stated}, but " + (f"it is {' or '.join(map(str, known))}" if known
                                                       else "no setting or constant has this name"))
    return wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_quoted_setting_has_the_value_of_the_code(page):
    assert mistakes(page.read_text()) == []


def test_the_pages_quote_most_numbers_of_the_method():
    assert sum(len(pairs(page.read_text())) for page in PAGES) >= 100


@pytest.mark.parametrize(("text", "wrong"), [
    ("The slack is `search.slack = 0.5`.", []),
    ("The slack is `search.slack = 0.4`.", ["search.slack = 0.4, but it is 0.5"]),
    ("It descends by `search.start = (150, 0.03)`, twice.", []),
    ("It descends by `search.start = (150, 0.04)`.", ["search.start = (150, 0.04), but it is (150, 0.03)"]),
    ("`recent = 2 / 3`, `pruning = true`, `rounds = null`", []),
    ("`ORBITS = 15`, `orbits = 16`", []),                                # the first is no name of a setting
    ("`orbits = 15`", ["orbits = 15, but it is 16"]),                    # a constant of a module
    ("`construction.ends = 0.75`, `reorient.ends = 24`", []),          # of one of several modules
    ("`ends = 24`", ["ends = 24, but it is 24 or 0.75"]),        # which of them?
    ("`binnedmeasure.grids = 3`", []),                                   # a default of a class
    ("`rendered.near_px = 0.05`", []),                                   # a field of a constant
    ("`no_such_name = 1`", ["no_such_name = 1, but no setting or constant has this name"]),
    ("```python\nno_such_name = 1\n`no_such_name = 1`\n```\n", []),      # an example, not a claim
])
def test_a_wrong_number_and_an_unknown_name_are_mistakes(text, wrong):
    assert mistakes(text) == wrong
