"""The table of collage search without its parts, over all kinds of pictures."""

import argparse

import pandas as pd
import pytest

from benchmarks import ablation


def fits(without: str, scores: dict[int, float]) -> list[dict]:
    return [{"without": without, "set": "suite", "target": target, "f1": score, "recovered": score > 0.9,
             "seconds": 10 * score, "commit": "0123456789abcdef"} for target, score in scores.items()]


def test_a_part_is_compared_with_the_whole_on_the_same_targets():
    frame = pd.DataFrame([*fits(ablation.FULL, {0: 0.9, 1: 0.95, 2: 0.1}), *fits("lines", {1: 0.85, 0: 0.9, 7: 0.5})])
    table = ablation.table(frame).set_index("without")
    assert list(table["fits"]) == [3, 2], "the target that only one of them was tried on is left out"
    assert table.loc["lines", "f1 difference"] == pytest.approx(-0.05)
    assert table.loc["lines", "f1 worst"] == pytest.approx(-0.1)
    assert table.loc["lines", "recovered difference"] == -0.5 and table.loc["lines", "changed"] == 1
    assert table.loc["lines", "f1 low"] <= -0.05 <= table.loc["lines", "f1 high"]
    assert table.loc[ablation.FULL, "f1 difference"] == 0


def test_every_part_has_its_options_and_the_whole_has_none():
    assert ablation.parts()[0] == ablation.FULL and ablation.options_without(ablation.FULL) == {}
    assert all(ablation.options_without(part) for part in ablation.parts()[1:])
    assert ablation.options_without("roots") == {"moves": {"root": 0.0}}


def test_several_parts_are_left_out_at_once():
    assert ablation.options_without("roots+reorient+rounds") == {"moves": {"root": 0.0, "reorient": 0.0}, "rounds": 1}
    assert ablation.known("roots+lines") == "roots+lines"
    with pytest.raises(argparse.ArgumentTypeError, match="there is no part rots"):
        ablation.known("rots+lines")


def test_the_sets_are_of_all_kinds_and_for_reporting():
    assert ablation.problems(["suite", "classics"], 2)[:2] == [("suite", 0), ("suite", 1)]
    for name in ("binary", "textbook_redrawn", "trees", "tone_curves"):
        assert len(ablation.problems([name], 3)) == 3


def test_no_fit_so_far_is_an_empty_table(tmp_path):
    assert list(ablation.read(tmp_path).columns) == ["without", "set", "target"]
    with pytest.raises(SystemExit, match="holds no fits yet"):
        ablation.report(tmp_path)


def test_the_report_is_one_table(tmp_path):
    lines = [*fits(ablation.FULL, {0: 0.9, 1: 0.95}), *fits("lines", {0: 0.9, 1: 0.85})]
    for line in lines:
        ablation.archive.append_line(tmp_path / ablation.archive.CODES, line)
    text = ablation.report(tmp_path)
    assert "| suite | lines | 2 | 1 | 0.875 | -0.050" in text and (tmp_path / "report.md").read_text() == text + "\n"
