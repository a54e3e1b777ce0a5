"""The core alone, without any extra, inverts, renders and films nothing; what needs an extra names it."""

import importlib.metadata
import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from places import ROOT

from fractal_exp.runtime.extras import EXTRAS, need

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

BLOCKER = '''
import json, sys
from importlib.machinery import PathFinder
blocked = set(json.loads(sys.argv[1]))
class Rest:
    def find_spec(name, path=None, target=None):
        return None if name.partition(".")[0] in blocked else PathFinder.find_spec(name, path, target)
sys.meta_path = [Rest if finder is PathFinder else finder for finder in sys.meta_path]
'''
INVERTS = '''
import numpy as np
from fractal_exp import View, codes, invert, render, suite
from fractal_exp.evaluation import evaluate
from fractal_exp.errors import InputError
found = invert(suite.target(codes.known("sierpinski_triangle"), 64), resolution=64, frame="keep", rounds=1,
               search={"restarts": 1, "moves": 1, "detail_moves": 0}, moves={"count": 0},
               growth={"usual": 4, "counts": (4,), "steps": 5}, progress=True)
assert found.history and render(found.code, View(zoom=3), resolution=32).shape == (32, 32)
found.overlay("overlay.png")
found.save("found")
assert found._repr_png_() and found.code._repr_png_()
chaotic = invert(suite.target(codes.known("sierpinski_triangle"), 64), method="chaotic", resolution=64, maps=2,
                 iterations=2, starts=1, trajectories=50, length=30)
print(chaotic)
'''


def distribution(requirement: str) -> str:
    return Requirement(requirement).name.lower().replace("_", "-")


def of_the_core() -> set[str]:
    """The distributions that `pip install fractal-exp` brings, by the metadata of those that are installed."""
    found, rest = set(), {distribution(each) for each in PROJECT["dependencies"]}
    while rest:
        name = rest.pop()
        try:
            requires = importlib.metadata.requires(name) or []
        except importlib.metadata.PackageNotFoundError:  # of another platform
            continue
        found.add(name)
        needed = (Requirement(each) for each in requires)
        rest |= {each.name.lower().replace("_", "-") for each in needed
                 if each.marker is None or each.marker.evaluate({"extra": ""})} - found
    return found


@pytest.fixture(scope="module")
def blocked() -> str:
    """The modules that no distribution of the core has, as JSON."""
    core = of_the_core() | {"fractal-exp", "pip"}
    modules = importlib.metadata.packages_distributions()
    names = sorted(module for module, owners in modules.items()
                   if not {owner.lower().replace("_", "-") for owner in owners} & core)
    assert {"pandas", "hydra", "mlflow", "kornia", "matplotlib"} <= set(names) and not {"torch", "numpy"} & set(names)
    return json.dumps(names)


def in_the_core(code: str, *arguments: str, folder: Path) -> subprocess.CompletedProcess:
    """Of a program whose first argument are the blocked modules."""
    return subprocess.run([sys.executable, "-c", BLOCKER + code, *arguments], cwd=folder, text=True,
                          capture_output=True)


@pytest.mark.slow
def test_the_core_alone_inverts_and_renders(blocked, tmp_path):
    done = in_the_core(INVERTS, blocked, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "all 2 iterations done" in done.stdout and (tmp_path / "found" / "inversion.json").exists()


NEEDS = [  # what is asked for, the library that it needs, and the extra that brings it
    ("from fractal_exp import codes, evaluation as e; e.evaluate(codes.known('fern'), codes.known('fern'))", "kornia",
     "study"),
    ("from fractal_exp.images import samples; samples.retina_vessels(64)", "skimage", "study"),
    ("from fractal_exp.images import samples; samples.snowflake(64)", "matplotlib", "study"),
    ("from fractal_exp.perceptual.distances import load; load('lpips_alex', weights='x.pth')", "torchvision",
     "perceptual"),
    ("from fractal_exp.rendering.film import write_film; write_film('x.gif', [])", "imageio", "video"),
    ("from fractal_exp import tracking; tracking.runs_frame('sqlite:///x.db', 'fits')", "pandas", "study"),
    ("from fractal_exp import tracking; tracking.find_run('sqlite:///x.db', 'fits', {})", "mlflow", "study"),
]
ASKS = '''
from fractal_exp import InputError
for code in json.loads(sys.argv[2]):
    try:
        exec(code)
        print("nothing is missing")
    except InputError as error:
        print(error)
'''


def test_what_needs_an_extra_names_it(blocked, tmp_path):
    done = in_the_core(ASKS, blocked, json.dumps([code for code, *_ in NEEDS]), folder=tmp_path)
    assert done.stdout.splitlines() == [f"{library} is not installed; pip install 'fractal-exp[{extra}]' brings it"
                                        for _, library, extra in NEEDS], done.stderr


STARTS = '''
from fractal_exp.cli import start
for program, *arguments in json.loads(sys.argv[2]):
    sys.argv[1:] = arguments
    try:
        getattr(start, program)()
        print(program, 0)
    except SystemExit as end:
        print(program, end.code)
'''


@pytest.mark.slow
def test_a_command_says_in_a_line_what_to_install(blocked, tmp_path):
    programs = ["train", "sweep"]
    done = in_the_core(STARTS, blocked, json.dumps([[program] for program in programs]), folder=tmp_path)
    assert done.stdout.splitlines() == [f"{program} 2" for program in programs], done.stderr
    for program, line in zip(programs, done.stderr.splitlines(), strict=True):
        assert line.startswith(f"fractal-{program}: error: ")
        assert line.endswith("is not installed; pip install 'fractal-exp[study]' brings it")


@pytest.mark.slow
def test_stills_and_the_suite_need_no_extra(blocked, tmp_path):
    calls = [["render", "fern", "fern.png", "--size", "64"], ["suite", "suite", "--count", "1", "--resolution", "64"]]
    done = in_the_core(STARTS, blocked, json.dumps(calls), folder=tmp_path)
    assert done.returncode == 0 and done.stdout.endswith("suite 0\n"), done.stderr
    assert (tmp_path / "fern.png").exists() and (tmp_path / "suite").is_dir()


def test_every_command_starts_a_module_that_exists():
    from fractal_exp.cli import start

    for command, target in PROJECT["scripts"].items():
        module, _, function = target.partition(":")
        assert module == "fractal_exp.cli.start" and command == f"fractal-{function}"
        own = "composed" if function == "train" else function
        assert getattr(start, function).args == (command, f"fractal_exp.cli.{own}")


def test_each_library_is_in_the_extra_that_it_is_said_to_be_in():
    owners = importlib.metadata.packages_distributions()
    extras = {name: {distribution(each) for each in requires}
              for name, requires in PROJECT["optional-dependencies"].items()}
    for library, extra in EXTRAS.items():
        of_it = {owner.lower().replace("_", "-") for owner in owners[library]}
        assert of_it & extras[extra] or library == "omegaconf", library  # omegaconf comes with hydra-core
    need(*EXTRAS)
