"""The table of collage search without its parts."""

import pandas as pd
import pytest

from benchmarks import ablation


def fits(part: str, scores: dict[int, float]) -> list[dict]:
    return [{"without": part, "set": "suite", "fractal": fractal, "f1_box": score, "f1_frame": score,
             "exact": score > 0.9, "seconds": 10 * score} for fractal, score in scores.items()]


def test_a_part_is_compared_with_the_whole_on_the_same_targets():
    frame = pd.DataFrame([*fits(ablation.FULL, {0: 0.9, 1: 0.95, 2: 0.1}), *fits("lines", {1: 0.85, 0: 0.9, 7: 0.5})])
    table = ablation.table(frame).set_index("without")
    assert list(table["fits"]) == [3, 2], "the target that only one of them was tried on is left out"
    assert table.loc["lines", "f1_frame difference"] == pytest.approx(-0.05)
    assert table.loc["lines", "exact difference"] == -0.5 and table.loc["lines", "changed"] == 1
    assert table.loc["lines", "f1_frame low"] <= -0.05 <= table.loc["lines", "f1_frame high"]
    assert table.loc[ablation.FULL, "f1_frame difference"] == 0


def test_every_part_has_its_options_and_the_whole_has_none():
    assert ablation.parts()[0] == ablation.FULL and ablation.options_without(ablation.FULL) == {}
    assert all(ablation.options_without(part) for part in ablation.parts()[1:])
    assert ablation.options_without("roots") == {"moves": {"root": 0.0}}


def test_fits_under_another_limit_are_not_mixed_in(tmp_path):
    frame = pd.DataFrame([each | {"limit": 40, "resolution": 256} for each in fits("lines", {0: 0.9})])
    ablation.check_same(frame, 40, 256, tmp_path)
    ablation.check_same(ablation.read(tmp_path), 20, 128, tmp_path)
    for limit, resolution in ((20, 256), (40, 128)):
        with pytest.raises(SystemExit, match="name another folder with --output"):
            ablation.check_same(frame, limit, resolution, tmp_path)
