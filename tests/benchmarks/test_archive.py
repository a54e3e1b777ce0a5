"""Published runs: their codes come back exactly, and can be judged without fitting again."""

from dataclasses import replace

import pytest
import torch

from benchmarks import archive, suite
from fractal_exp.suite import random_suite

CODE = replace(random_suite(1, 7)[0], meta={})


def fit(**changes) -> archive.Fit:
    return archive.Fit(**{"fractal": 0, "suite": 7, "kind": "grey", "resolution": 64, "method": "collage",
                          "options": {}, "seconds": 1.0, "code": CODE,
                          "stages": (archive.Stage("search", 0.5, CODE),), **archive.here()} | changes)


def test_codes_come_back_to_the_last_bit(tmp_path):
    probabilities = torch.full((len(CODE),), 1 / len(CODE))
    archive.append(tmp_path, fit(fractal=3, code=replace(CODE, probabilities=probabilities)))
    archive.append(tmp_path, fit(fractal=1))
    first, second = archive.read(tmp_path)
    assert (first.fractal, second.fractal) == (1, 3)
    assert torch.equal(first.code.linear, CODE.linear) and torch.equal(first.code.offset, CODE.offset)
    assert first.code.probabilities is None and torch.equal(second.code.probabilities, probabilities)
    assert torch.equal(first.stages[0].code.linear, CODE.linear) and first.stages[0].seconds == 0.5
    assert archive.missing(tmp_path, range(4)) == [0, 2]


def test_a_folder_holds_one_run(tmp_path, monkeypatch):
    archive.append(tmp_path, fit())
    monkeypatch.setattr("sys.argv", ["suite", "collage", "--kind", "binary", "--output", str(tmp_path)])
    with pytest.raises(SystemExit, match="another run"):
        suite.main()


def test_a_line_that_a_kill_cut_short_is_left_out_and_the_next_begins_anew(tmp_path):
    archive.append(tmp_path, fit(fractal=0))
    archive.append(tmp_path, fit(fractal=1))
    path = tmp_path / archive.CODES
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.warns(UserWarning, match="codes.jsonl: line 2 is incomplete"):
        assert archive.missing(tmp_path, range(3)) == [1, 2]
    archive.append(tmp_path, fit(fractal=2))
    with pytest.warns(UserWarning, match="line 2 is incomplete"):
        assert [each.fractal for each in archive.read(tmp_path)] == [0, 2]
    assert path.read_text().count("\n") == 3
