"""The notebooks run from top to bottom, with quick values in place of those of their first code cell."""

import ast
from collections.abc import Iterator

import nbformat
import pytest
from commands import run_here
from jupyter_client import KernelManager
from nbclient import NotebookClient
from places import ROOT

from fractal_exp.cli import sweep

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
SEARCH = {"rounds": 1, "search": {"restarts": 1, "moves": 3, "detail_moves": 1}, "moves": {"count": 1},
          "growth": {"enabled": False}}
QUICK = {  # values of the parameters that take moments: they show that everything runs, not what it can do
    "01_quickstart": {"resolution": 64, "options": SEARCH},
    "02_ablations": {},  # reads a sweep, see `output`
    "03_anatomy_of_a_fit": {"resolution": 64, "sizes": {"iterations": 20, "starts": 2, "scouting": 5,
                                                        "trajectories": 100, "length": 60}},
    "04_collage": {"resolution": 64, "options": SEARCH},
}


def parameters(notebook):
    """The cell tagged `parameters`, as its readers and papermill know it."""
    [cell] = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", ())]
    return cell


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    """The folder of a sweep of two rows on one fractal."""
    folder = tmp_path_factory.mktemp("outputs")
    words = ["ablations", "scale=smoke", "resolution=32", "evaluation.points_in_view=20000", "iterations=6",
             "sweep.count=1", "ablation=no_mip,none", f"output={folder}"]
    status, printed = run_here(sweep, *words)
    assert status == 0, printed
    return folder


@pytest.fixture(scope="module")
def kernel() -> Iterator[KernelManager]:
    """One for all notebooks, which imports what they need once; each begins with no name defined."""
    manager = KernelManager(kernel_name="python3")
    manager.start_kernel()
    yield manager
    manager.shutdown_kernel(now=True)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, request, tmp_path, kernel):
    notebook = nbformat.read(path, as_version=4)
    quick = dict(QUICK[path.stem])
    if "output = " in parameters(notebook).source:
        quick["output"] = str(request.getfixturevalue("output"))
    named = {name.id for node in ast.walk(ast.parse(parameters(notebook).source))
             if isinstance(node, ast.Assign) for name in ast.walk(node) if isinstance(name, ast.Name)}
    assert set(quick) <= named, "a quick value of a parameter that the notebook does not have"
    values = nbformat.v4.new_code_cell("\n".join(f"{name} = {value!r}" for name, value in quick.items()))
    notebook.cells.insert(notebook.cells.index(parameters(notebook)) + 1, values)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(f"%reset -f\n%cd -q {tmp_path}"))
    NotebookClient(notebook, km=kernel, timeout=300).execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_defines_nothing_and_has_no_plumbing_in_sight(path):
    cells = [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]
    for node in (node for cell in cells for node in ast.walk(ast.parse(cell.source))):
        assert not isinstance(node, ast.FunctionDef | ast.ClassDef), f"{node.name} belongs into the package"
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = {getattr(node, "module", None), *(alias.name for alias in node.names)}
            assert not modules & {"os", "sys", "subprocess", "tempfile"}, "belongs into the test that runs it"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_with_what_it_shows_and_without_errors(path):
    cells = [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]
    outputs = [output for cell in cells for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs), "a reader sees pictures without running it"
    assert not [output for output in outputs if output.output_type == "error" or output.get("name") == "stderr"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1)), "run once, from top to bottom"
