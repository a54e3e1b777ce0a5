"""Rounds of collage search: when another begins, what it may find, and how it goes on after an interruption."""

import math
from dataclasses import replace

import pytest
import torch

from fractal_exp.methods.collage import births, search, stages
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage import method as methods
from fractal_exp.methods.collage.measure import LEVELS
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.picture import Picture
from fractal_exp.methods.collage.search import Search, Tiling
from fractal_exp.methods.collage.stages import Problem, plan
from fractal_exp.methods.collage.work import Work
from fractal_exp.ops.collage import Descent
from fractal_exp.runtime.checkpoint import Checkpoint

TURN = torch.tensor([[0.0, -0.97, 0.98, 0, 0.1, 0]])  # of a square, say, about its middle


def small(**options):
    return Collage(**{"islands": 1, "moves": 3, "rounds": 3, "detail_moves": 2, "picture_moves": 2, "previews": 1}
                   | options)


def test_another_round_begins_only_where_the_picture_is_far_off(triangle):
    code, image = triangle
    problem = Problem(image, LEVELS["density"], 0, 1, 64, None, None)
    stages = plan(problem, rounds=3, islands=3, moves=1, detail_moves=1, picture_moves=0)
    later = 3 * ["search"] + ["detail", "picture"]
    assert [stage.name for stage in stages] == ["search", *later, *later, *later, "last digits"]
    maps = affine.from_code(code)
    first, second, end = 5, 10, len(stages) - 1
    for number, noises, angle, ends_at in ((second, 1.5, 0.1, end), (second, 2.5, 0.1, second + 1),
                                           (first, 1, 0.1, end), (first, 10, 0.5, end), (first, 1.5, 0.1, first + 1)):
        stage, work = stages[number], Work(stage=number, best=Tiling(maps, affine.volumes(maps), 0.0), pool=maps)
        stage.open(work)
        assert stage.search.noises(stage.begin(work)) < 2, "the true code"
        stage.search.noises = lambda now, noises=noises: noises
        stage.search.picture.angle = lambda error, angle=angle: angle
        after = stage.close(replace(work, tiling=stage.begin(work)))
        assert after.stage == ends_at and len(after.result.maps) == 3
    assert after.best is None and len(after.pool) == 6
    again = stages[6]
    again.open(after)
    assert again.close(replace(after, tiling=again.begin(after))).best is not None
    snapshot = Work.of(after.snapshot(), "cpu")
    assert torch.equal(snapshot.before.maps, after.before.maps) and snapshot.best is None


def test_a_round_after_an_isometry_does_without(triangle):
    code, image = triangle
    problem = Problem(image, LEVELS["density"], 0, 1, 64, None, None)
    stages = plan(problem, rounds=4, islands=1, moves=1, detail_moves=1, picture_moves=0)
    right = affine.from_code(code)

    def limits(maps):
        before = Tiling(maps, affine.volumes(maps), 1.0)
        for stage in stages[:-1]:
            stage.open(Work(best=before, before=before if stage.round else None))
            yield getattr(stage.search, "smaller", None)  # what is judged by the picture has no such limit

    assert list(limits(torch.cat([right, TURN]))) == 2 * [1, 1, 1, None, 0.9, 0.9, 0.9, None]
    assert list(limits(right)) == 4 * [1, 1, 1, None]


def test_a_search_without_isometries_finds_and_takes_none(triangle, monkeypatch):
    """Given turns only: they start all sets, are born, and lie in the pool."""
    _, image = triangle
    monkeypatch.setattr(affine, "random_matrices", lambda count, *_: TURN[:, :4].view(1, 2, 2).expand(count, 2, 2))
    monkeypatch.setattr(births, "_blobs", lambda lacking, place, *_: TURN.expand(len(place), 6))
    monkeypatch.setattr(births, "COARSE", replace(births.COARSE, steps=1))  # descent alone would lead away from them
    monkeypatch.setattr(births, "FINE", replace(births.FINE, steps=1))
    monkeypatch.setattr(search, "START", replace(search.START, steps=1))
    most = {}
    for smaller in (1.0, 0.9):
        some = Search(LEVELS["density"].measure(image), size=32, coarse=16, smaller=smaller)
        born, _ = births.births(some.coarse, some.measure, some.slack[None], 0.5, [births.LARGE], count=6, kept=2,
                                smaller=smaller, generator=torch.Generator().manual_seed(0))
        moved, _, _ = some.move(TURN, torch.tensor([0.5]), Descent(1))
        monkeypatch.setattr(some, "_mixture", lambda pool, *_: pool)
        most[smaller] = [float(affine.smaller_singular(maps).max()) for maps in
                         (some.start(), born, moved, some.mixed(torch.cat([moved * 0.5, TURN])))]
    assert max(most[0.9]) < 0.9 + 1e-4 and min(most[1.0]) > 0.9


def test_how_many_rounds_there_are_depends_on_what_the_greys_mean(triangle, monkeypatch):
    _, image = triangle
    rounds = []

    class Planned(Exception):
        pass

    def only_plan(problem, **options):
        rounds.append(options["rounds"])
        raise Planned

    monkeypatch.setattr(methods, "plan", only_plan)
    for options in ({}, {"levels": "coverage"}, {"rounds": 3}):
        with pytest.raises(Planned):
            small(**{"rounds": None} | options).reconstruct(image)
    assert rounds == [4, 2, 3]


def test_later_rounds_go_on_where_they_were_interrupted_and_progress_never_falls(triangle, tmp_path, monkeypatch):
    _, image = triangle
    monkeypatch.setattr(stages.Retouch, "_is_wrong", lambda stage, tiling: stage.others > 0)
    path, parts = tmp_path / "search.safetensors", []
    whole = small(rounds=2).reconstruct(image, on_step=lambda p: parts.append(p.fraction)).code
    assert parts == sorted(parts) and parts[-1] == 1 and len(set(parts)) > 10
    with monkeypatch.context() as patch:
        patch.setattr(stages.Detail, "begin", _interrupt_in_the_second_round)
        with pytest.raises(KeyboardInterrupt):
            small(rounds=2).reconstruct(image, checkpoint=Checkpoint(path))
    resumed = small(rounds=2).reconstruct(image, checkpoint=Checkpoint(path, resume=True)).code
    assert torch.equal(whole.linear, resumed.linear) and torch.equal(whole.offset, resumed.offset)


def _interrupt_in_the_second_round(stage, work):
    if stage.round == 1:
        raise KeyboardInterrupt
    return stage.search.resume(work.best.maps, work.best.weights)


def test_the_angle_of_an_error_is_what_all_pixels_are_off_by():
    target = torch.full((32, 32), 0.5)
    picture = Picture(target, LEVELS["density"])
    darker = torch.sin(torch.full_like(target, math.pi / 4 - 0.2)) ** 2
    assert picture.angle(picture.error(darker)) == pytest.approx(0.2, rel=0.01)
