"""Where the time of collage search goes."""

import pytest

from benchmarks import search_shares
from benchmarks.ablation import Grey

FEW = {"rounds": 1, "search": {"restarts": 1, "moves": 2, "detail_moves": 1}, "moves": {"count": 1}}


@pytest.mark.parametrize(("file", "function", "part"), [
    ("/a/fractal_exp/ops/collage/cpu_kernels.py", "descend", "descents of maps"),
    ("/a/fractal_exp/ops/collage/cpu_kernels.py", "orbit_bins", "measures of orbits and images"),
    ("/a/fractal_exp/ops/histogram/cpu.py", "scatter", "renderings"),
    ("~", "<built-in method torch.cdist>", "torch"), ("~", "<built-in method builtins.len>", "Python and NumPy"),
    ("/a/fractal_exp/methods/collage/pipeline.py", "run", "Python and NumPy")])
def test_each_function_belongs_to_one_part(file, function, part):
    assert search_shares.part_of(file, function) == part


def test_the_shares_of_a_search_are_whole(monkeypatch):
    monkeypatch.setitem(search_shares.KINDS, "suite", Grey(7, 1, 64))
    found = search_shares.measured("suite", 1, FEW)
    assert found["searches"] == 1 and found["seconds"] > 0
    assert sum(found["parts"].values()) == pytest.approx(1) == sum(found["stages"].values())
    assert {"descents of maps", "renderings"} <= found["parts"].keys() and {"search", "image"} <= found["stages"].keys()
