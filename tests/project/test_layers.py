"""A file imports only from floors below its own, or from its own folder."""

import ast
from pathlib import Path

import pytest

import fractal_exp

PACKAGE = Path(fractal_exp.__file__).parent
FLOORS = {  # of each folder with sub-folders, from the ground up; what is named is a file or a folder in it
    "": [
        {"errors"},
        {"runtime", "data"},
        {"ifs"},
        {"codes", "dimension", "images"},
        {"ops"},
        {"rendering", "perceptual", "tracking"},
        {"suite", "viewer"},
        {"targets", "datasets"},
        {"evaluation", "colouring"},
        {"cameras"},
        {"likeness"},
        {"methods", "verdict"},
        {"studies", "training"},
        {"inversion"},
        {"api"},
        {"studio"},
        {"cli"},
    ],
    "ifs": [{"canvas", "contraction_kernels", "numbers"}, {"colours", "contraction"}, {"code"},
            {"address_tree", "affine"}, {"attractor"}, {"formats"}],
    "ops": [{"cuda_launch", "filters", "scale"}, {"backends"}, {"chaos"},
            {"collage", "counts", "histogram", "occupancy", "sequences", "splatting"}],
    "methods": [{"base"}, {"history", "pretrained", "stepwise"},
                {"chaotic", "collage", "learning_fractals", "population", "super_resolution"}, {"neural_regression"},
                {"amortized"}],
    "methods/collage": [{"params", "limits"}, {"bins"}, {"state"}, {"measure"}, {"image"},
                        {"simplify", "growth", "trees"}, {"moves"}, {"stages"}, {"pipeline"}, {"given"},
                        {"method"}],
}
FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def parts(path: Path) -> list[str]:
    return list(path.relative_to(PACKAGE).with_suffix("").parts)


def imported(path: Path, folder: list[str]) -> set[str]:
    """The files and folders in a folder that a file below it imports from, its own aside."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            here = parts(path)[:-1]
            base = here[: len(here) - node.level + 1] + (node.module.split(".") if node.module else [])
            if base[:len(folder)] == folder:
                found |= {base[len(folder)]} if len(base) > len(folder) else {alias.name for alias in node.names}
    return found - {parts(path)[len(folder)], "__version__"}


@pytest.mark.parametrize("folder", FLOORS)
def test_imports_go_down(folder):
    floor = {name: height for height, names in enumerate(FLOORS[folder]) for name in names}
    inside, wrong = [each for each in folder.split("/") if each], []
    for path in FILES:
        own = parts(path)
        if own[:len(inside)] == inside and len(own) > len(inside) and (name := own[len(inside)]) != "__init__":
            wrong += [f"{'/'.join(own)} (floor {floor[name]}) imports from {other}" for other in imported(path, inside)
                      if other in floor and floor[other] >= floor[name]]
    assert not wrong


def test_every_folder_with_sub_folders_is_guarded():
    assert {"/".join(parts(path)[:-2]) for path in FILES if path.name == "__init__.py"} == set(FLOORS)


@pytest.mark.parametrize("folder", FLOORS)
def test_everything_has_its_floor(folder):
    here = PACKAGE / folder
    names = {path.stem for path in here.glob("*.py")} | {path.parent.name for path in here.glob("*/__init__.py")}
    assert names - {"__init__"} == {name for floor in FLOORS[folder] for name in floor}


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
