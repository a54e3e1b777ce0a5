"""What travels in the wheel."""

import subprocess
import sys

import pytest
from places import ROOT


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> set[str]:
    """The files of the package as setuptools gathers them for a wheel."""
    folder = tmp_path_factory.mktemp("build")
    code = ("from setuptools import setup; setup(script_name='setup.py', script_args=['-q', 'egg_info', '--egg-base', "
            f"{str(folder)!r}, 'build_py', '--build-lib', {str(folder / 'lib')!r}])")
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True)
    return {str(path.relative_to(folder / "lib")) for path in (folder / "lib").rglob("*") if path.is_file()}


def test_the_wheel_holds_every_module_and_what_is_read_beside_them(built):
    modules = {str(path.relative_to(ROOT)) for path in (ROOT / "fractal_exp").rglob("*.py")}
    assert modules - built == set()
    assert {"fractal_exp/py.typed", "fractal_exp/data/fractal_features.safetensors", "fractal_exp/conf/train.yaml",
            "fractal_exp/data/neural_regression.safetensors",
            "fractal_exp/conf/pretraining/neural_regression_laptop.yaml",
            "fractal_exp/sweeps/ablations.yaml"} <= built
    page = {str(path.relative_to(ROOT)) for path in (ROOT / "fractal_exp/viewer/static").iterdir()}
    assert len(page) > 10 and page - built == set()
