"""The benchmark of collage search begun with the amortised network's maps."""

import json

import pytest
import torch

from benchmarks import archive, starts
from benchmarks.ablation import SEED, CoreTime
from fractal_exp import codes, suite
from fractal_exp.ifs.attractor import normalize
from fractal_exp.methods.amortized.method import Amortized
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.methods.collage.maps import from_code
from fractal_exp.methods.collage.state import State


def test_the_search_begins_with_the_answer_of_the_network(monkeypatch):
    answer = normalize(codes.known("sierpinski_triangle"))
    monkeypatch.setattr(Amortized, "reconstruct", lambda self, image: CodeReconstruction(answer))
    image = suite.target(answer, 64, "grey")
    method = CoreTime(seconds=None, previews=0, search={"pruning": False, "merging": False})
    state = State.of(starts.network(image, method).load(), "cpu")
    assert state.done is None and state.step == 0, "the first restart is the one that goes on"
    assert torch.allclose(state.now.maps, from_code(answer), atol=.05)
    assert starts.random_maps(image, method).load() is None


def test_both_searches_have_the_same_time(monkeypatch):
    limits = []
    monkeypatch.setattr(CoreTime, "reconstruct", lambda self, image, checkpoint: limits.append(self.seconds)
                        or CodeReconstruction(normalize(archive.true_code(3, SEED))))
    for start in starts.STARTS:
        made = starts.fit(start, 3, 30, 64)
        assert made["start"] == start and made["exact"] and made["f1_frame"] > .95
    with_random, with_network = limits
    assert with_random == pytest.approx(30, abs=.02) and with_network < with_random, "the network's time counts"


def test_the_starts_are_compared_on_the_same_fractals(tmp_path):
    def line(start, fractal, score):
        return {"start": start, "fractal": fractal, "limit": 5, "f1_box": score, "f1_frame": score, "exact": score > .9,
                "seconds": 4.0, "commit": "0123456789abcdef"}

    lines = [line(starts.RANDOM, 0, .8), line(starts.NETWORK, 0, .95), line(starts.RANDOM, 1, .5),
             line(starts.NETWORK, 1, .6), line(starts.RANDOM, 2, .1)]
    (tmp_path / archive.CODES).write_text("".join(json.dumps(each) + "\n" for each in lines))
    text = starts.report(tmp_path)
    assert "2 fractals" in text and "| f1_box | 0.650 | 0.775 | +0.125 [+0.100, +0.150] |" in text
    assert "| exact | 0.000 | 0.500 | +0.500" in text and (tmp_path / "report.md").read_text() == text
    (tmp_path / archive.CODES).write_text(json.dumps(lines[0]) + "\n")
    with pytest.raises(SystemExit, match="both starts yet"):
        starts.report(tmp_path)
