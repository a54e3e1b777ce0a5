"""The benchmark of collage search begun with the amortised network's maps."""

import json

import pytest
import torch

from benchmarks import archive, starts
from benchmarks.ablation import SEED, CoreTime
from fractal_exp import suite
from fractal_exp.methods.amortized.method import Amortized


def test_the_search_goes_on_from_the_networks_maps():
    image = suite.target(archive.true_code(3, SEED), 64, "grey")
    method = CoreTime(seconds=None, previews=0)
    snapshot = starts.network(image, method).load()
    found = Amortized().reconstruct(image).code
    assert 1 <= len(snapshot.tensors["current/maps"]) <= len(found)
    nearest = torch.cdist(snapshot.tensors["current/maps"][:, 4:].double(), found.offset.double()).min(1).values
    assert nearest.max() < .5, "descent moves a map, it does not put another one in its place"
    assert snapshot.numbers["done"] is None and snapshot.iteration == 0
    assert starts.random_maps(image, method).load() is None


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
    with pytest.raises(SystemExit, match="no fits yet"):
        starts.report(tmp_path / "absent")
