"""A file imports only from floors below its own, or from its own folder."""

import ast
import tomllib
from pathlib import Path

import pytest

import fractal_exp

PACKAGE = Path(fractal_exp.__file__).parent
FLOORS = [  # from the ground up; what is named alone is a file or a folder of the package
    {"errors"},
    {"runtime", "data"},
    {"ifs"},
    {"codes", "images", "viewer"},
    {"ops"},
    {"rendering", "perceptual", "tracking"},
    {"suite"},
    {"targets"},
    {"evaluation", "colouring"},
    {"methods"},
    {"perceptual_training", "studies", "verdict"},
    {"pretraining"},
    {"inversion"},
    {"api"},
    {"studio"},
    {"cli"},
]
# What a code shows of itself in a notebook, as an SVG and as a page, imported when it is shown.
EXCEPTIONS = {("ifs", "rendering"), ("ifs", "viewer")}
FLOOR = {name: floor for floor, names in enumerate(FLOORS) for name in names}
FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def parts(path: Path) -> list[str]:
    return list(path.relative_to(PACKAGE).with_suffix("").parts)


def imported(path: Path) -> set[str]:
    """The files and folders at the top of the package that a file imports from, its own aside."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            folder = parts(path)[:-1]
            base = folder[: len(folder) - node.level + 1] + (node.module.split(".") if node.module else [])
            found |= {base[0]} if base else {alias.name for alias in node.names}
    return found - {parts(path)[0], "__version__"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: "/".join(parts(path)))
def test_imports_go_down(path):
    own = parts(path)[0]
    wrong = sorted(name for name in imported(path) if name in FLOOR and FLOOR[name] >= FLOOR[own]
                   and (own, name) not in EXCEPTIONS)
    assert not wrong, f"{own} (floor {FLOOR[own]}) imports from {', '.join(wrong)}"


def test_a_wheel_holds_every_folder():
    settings = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text())
    folders = {".".join(["fractal_exp", *parts(path)[:-1]]) for path in PACKAGE.rglob("__init__.py")}
    assert set(settings["tool"]["setuptools"]["packages"]) == folders | {"fractal_exp.conf", "fractal_exp.sweeps"}


def test_every_folder_has_its_floor():
    assert {parts(path)[0] for path in FILES} == set(FLOOR)


@pytest.mark.parametrize("library, folder", [("mlflow", "tracking"), ("hydra", "cli")])
def test_a_framework_is_imported_in_one_folder_alone(library, folder):
    users = set()
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else [
                alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if any(name.split(".")[0] == library for name in names):
                users.add(parts(path)[0])
    assert users == {folder}


def test_no_function_of_the_operations_has_more_than_ten_arguments():
    """What belongs together is packed, for kernels too; the keywords of public functions do not count."""
    crowded = []
    for path in sorted((PACKAGE / "ops").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                keywords = node.args.kwonlyargs if node.name.startswith("_") else []
                count = len([*node.args.posonlyargs, *node.args.args, *keywords])
                crowded += [f"{'/'.join(parts(path))}: {node.name} has {count}"] if count > 10 else []
    assert not crowded
