"""Benchmark results are JSON lines of one shape, which are only added to, and whose history can be drawn."""

import json
import re
from datetime import datetime

import numpy as np
import pytest
from PIL import Image
from places import ROOT

from benchmarks import history, record


def test_a_record_is_added_and_read_back(tmp_path):
    path = tmp_path / "new" / "ops.jsonl"
    record.append(path, "ops", {"ms": 3.5}, {"twin / kernel": 20.0})
    record.append(path, "ops", {"ms": 3.0}, {})
    first, second = record.read(path)
    assert first["figures"] == {"ms": 3.5} and first["ratios"] == {"twin / kernel": 20.0} and second["ratios"] == {}
    assert tuple(first) == record.KEYS and re.fullmatch(r"[0-9a-f]{40}", first["commit"])
    assert datetime.fromisoformat(first["date"]).tzinfo is not None and "cores" in first["machine"]
    assert "torch" in first["environment"] and "commit" not in first["environment"]


def test_records_come_oldest_first_and_another_shape_is_refused(tmp_path):
    path = tmp_path / "ops.jsonl"
    lines = [dict.fromkeys(record.KEYS, {}) | {"date": date} for date in ("2026-02-01", "2026-01-01")]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert [each["date"] for each in record.read(path)] == ["2026-01-01", "2026-02-01"]
    path.write_text(json.dumps({"threads": 2}) + "\n")
    with pytest.raises(ValueError, match="line 1: a record has the keys benchmark, date, commit"):
        record.read(path)


@pytest.mark.parametrize("path", sorted(record.RESULTS.glob("*.jsonl")), ids=lambda path: path.stem)
def test_the_results_kept_here_are_records(path):
    for each in record.read(path):
        assert re.fullmatch(r"[0-9a-f]{40}", each["commit"]) and each["machine"] and each["figures"]
        assert datetime.fromisoformat(each["date"]).tzinfo is not None
        assert all(isinstance(value, float) and value > 0 for value in each["ratios"].values())


def test_no_result_lies_outside_the_records():
    assert not list(record.RESULTS.glob("*.json"))
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for name in re.findall(r"benchmarks/results/([\w.]+\.jsonl?)", page.read_text()):
            assert (record.RESULTS / name).exists(), f"{page.name} names {name}"


def test_the_history_is_drawn_from_all_files(tmp_path):
    path = tmp_path / "ops.jsonl"
    record.append(path, "ops", {"ms": 3.5}, {"twin / kernel": 20.0})
    record.append(path, "iteration", {"ms": 3.5}, {"twin / kernel": 20.0})
    found = history.gather(tmp_path)
    assert list(found) == ["ops", "iteration"]
    one = np.asarray(Image.open(history.draw({"ops": found["ops"]}, tmp_path / "one.png")).convert("L"))
    both = np.asarray(Image.open(history.draw(found, tmp_path / "both.png")).convert("L"))
    assert both.shape[0] == pytest.approx(2 * one.shape[0], rel=0.01) and one.std() > 5
