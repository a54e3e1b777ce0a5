"""The parameters of collage search: each is documented, reached by Hydra, checked, and every part can be left out."""

import re
from functools import partial
from pathlib import Path

import fractal_exp.conf
import fractal_exp.sweeps
import pytest
import yaml
from collage_helpers import image_search, merged, small, tied
from configured import plain
from fractal_exp.conf.generate import hydra_config

from fractal_exp import InputError, suite
from fractal_exp.ifs import affine
from fractal_exp.methods.collage.moves.search import MOVES
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.runtime.params import Params

CONF = Path(next(iter(fractal_exp.conf.__path__)))
PARTS = sorted(path.stem for path in (CONF / "without").glob("*.yaml"))
FULL = "nothing"
EACH_PART = [pytest.param(part, marks=[] if part in (FULL, "rounds") else pytest.mark.slow) for part in PARTS]


composed = partial(plain, "method=collage")


def leaves(node: dict, prefix: str = "") -> dict:
    return {key: value for name, inner in node.items() for key, value in (
        leaves(inner, f"{prefix}{name}.") if isinstance(inner, dict) else {f"{prefix}{name}": inner}).items()}


def test_hydra_has_every_parameter_with_its_docstring():
    assert (CONF / "method" / "collage.yaml").read_text() == hydra_config("method/collage"), (
        "python -m fractal_exp.conf.generate method/collage > conf/method/collage.yaml")
    settings = leaves(composed()["method"])
    for name, info in CollageParams.leaves():
        assert info.description, name
        assert name in settings, name


def test_a_scale_sets_the_sizes_of_collage_search_wherever_it_searches():
    size = {"rounds": 1, "search.restarts": 1, "search.moves": 8, "search.detail_moves": 2, "moves.count": 2}
    assert leaves(composed("scale=smoke")["method"]).items() >= size.items()
    begun = composed("scale=smoke", "method=chaotic", "init=collage")["method"]["init"]
    assert leaves(begun).items() >= size.items()
    assert composed("scale=smoke", "method.search.moves=3", "without=rounds")["method"]["search"]["moves"] == 3


@pytest.mark.parametrize("part", EACH_PART)
def test_leaving_a_part_out_changes_the_parameters_that_it_names_and_nothing_else(part):
    text = yaml.safe_load((CONF / "without" / f"{part}.yaml").read_text()) or {}
    changed, full = leaves(composed(f"without={part}")), leaves(composed())
    different = {name for name in full if full[name] != changed[name]}
    assert different == {name for name in leaves(text)}
    assert changed["variant"] == ("full" if part == FULL else f"without_{part}")


def test_the_ablation_leaves_out_every_part_that_its_targets_have():
    text = (Path(next(iter(fractal_exp.sweeps.__path__))) / "collage_ablation.yaml").read_text()
    others = set(re.findall("`(.+?)`", "".join(line for line in text.splitlines() if line.startswith("#"))))
    tried = yaml.safe_load(text)["hydra"]["sweeper"]["params"]["without"].split(",")
    assert others <= set(PARTS) and set(tried) == set(PARTS) - others


# Through every stage, in as few moves as it takes.
PASSING = {"search": {"moves": 1, "detail_moves": 1, "grid": 32, "detail_grid": 32}, "moves": {"count": 1}}


@pytest.mark.parametrize("part", EACH_PART)
def test_a_search_without_a_part_ends_with_a_code(part, triangle):
    options = (yaml.safe_load((CONF / "without" / f"{part}.yaml").read_text()) or {}).get("method", {})
    code = small(**merged(PASSING, options)).reconstruct(suite.target(triangle[0], 48)).code
    assert len(code) >= 2


AT_THE_END = {  # of their ranges: what is off, one, or as small as it may be
    "few": {"search": {"restarts": 1, "proposals": 1, "mixture": False, "pruning": False, "moves": 3,
                       "detail_moves": 0, "slack": 0}, "births": {"count": 8},
            "moves": {"count": 0}, "refine": {"steps": 0}, "image": {"finest": 8}},
    "coarse": {"search": {"grid": 16, "detail_grid": 16}, "moves": {"grid": 16},
               "gauss_newton": {"strides": [1.0]}, "camera": {"supersample": 1}},
    "fine": {"search": {"grid": 1024, "detail_grid": 1024, "moves": 1, "detail_moves": 1},
             "refine": {"finest": 2048, "steps": 3}, "moves": {"grid": 1024, "polish_ends": 1, "polish_starts": 0}},
}


@pytest.mark.parametrize("options", [pytest.param(options, id=name, marks=[] if name == "few" else pytest.mark.slow)
                                     for name, options in AT_THE_END.items()])
def test_a_search_at_the_ends_of_ranges_ends_with_a_code(options, triangle):
    code = small(**options).reconstruct(suite.target(triangle[0], 64)).code
    assert len(code) >= 1


def test_every_move_has_odds_of_its_own():
    assert set(MOVES) <= set(type(CollageParams().moves).model_fields)


@pytest.mark.parametrize(("maps", "options", "open_moves"), [
    (1, {}, {"birth"}), (2, {}, {"birth", "reorient", "replace"}), (3, {}, set(MOVES)),
    (3, {"maps": 3}, {"reorient", "replace"}), (2, {"maps": 3}, {"birth", "reorient", "replace"}),
    (4, {"at_most": 4}, set(MOVES) - {"birth"})])
def test_a_code_admits_the_moves_for_which_it_has_maps(maps, options, open_moves, triangle):
    odds = image_search(triangle[1], **options).odds(maps)
    assert {name for name, each in zip(MOVES, odds, strict=True) if each} == open_moves


def test_no_move_is_made_where_all_are_switched_off(triangle):
    search = image_search(triangle[1], moves=dict.fromkeys(MOVES, 0.0))
    now = search.judged(tied(affine.from_code(triangle[0])))
    assert search.step(now, 0) is now


@pytest.mark.parametrize(("options", "message"), [
    ({"moves": {"reorient": -1}}, "moves.reorient must be at least 0, got -1"),
    ({"moves": {"reorient": float("nan")}}, "moves.reorient must be a finite number, got nan"),
    ({"moves": {"reorint": 1}}, "there is no parameter moves.reorint; did you mean 'reorient'"),
    ({"search": {"slack": 1.0}}, "search.slack must be at least 0 and below 1, got 1.0"),
    ({"search": {"restarts": 2.5}}, "search.restarts must be a whole number, got 2.5"),
    ({"frame": {"enabled": "yes"}}, "frame.enabled must be true or false, got 'yes'"),
    ({"saturation": 3}, "saturation must be a mapping of settings, got 3"),
    ({"maps": 3, "at_most": 4}, "give one of the number of maps (maps), its upper bound (at_most or bytes) and the "
                                "likeness to be reached, not two; got maps=3 and at_most=4"),
    ({"likeness": 1.5}, "likeness must be at most 1, got 1.5"),
    ({"likeness": 0.0}, "likeness must be above 0, got 0.0"),
    ({"bytes": 12}, "bytes must be at least 24, got 12"),
    ({"growth": {"counts": []}}, "growth.counts must be a list of at least 1 values, got []"),
    ({"search": {"grid": 48}}, "search.grid must be a power of two, got 48"),
    ({"moves": {"grid": 2048}}, "moves.grid must be at least 16 and at most 1024, got 2048"),
    ({"stages": {"largest_side": 2048}}, "stages.full_side must be at least largest_side, which is 2048; got 1024"),
    ({"growth": {"counts": [4, 8, 8]}}, "growth.counts must ascend, got 8 after 8"),
    ({"search": {"grid": 256}}, "search.detail_grid must be at least grid, which is 256; got 128"),
    ({"population": {"first": 20}}, "population.first must be at least size, which is 48; got 20"),
    ({"camera": {"estimate": False, "pen_px": 1.5}}, "camera.pen_px must be null if estimate is false, got 1.5"),
    ({"likeness": 0.9, "growth": {"enabled": False}},
     "likeness is reached by growth, but growth.enabled is false; got 0.9"),
])
def test_a_parameter_out_of_range_is_refused_by_its_full_name(options, message):
    with pytest.raises(InputError, match="^" + re.escape(message)):
        CollageParams().updated(**options)


@pytest.mark.parametrize("options", [
    {"camera": {"blur_px": 2.0, "estimate": False}}, {"camera": {"pen_px": 1.5, "blur_px": 0.5}},
    {"camera": {"gain": 0.5, "blur_px": 0.5}}, {"likeness": 0.9}, {"bytes": 96, "growth": {
        "enabled": False}}, {"search": {"grid": 128}}, {"births": {"count": 8}}], ids=str)
def test_parameters_that_agree_are_taken(options):
    assert CollageParams().updated(**options) != CollageParams()


@pytest.mark.parametrize(("words", "message"), [
    (["method.moves.reorient=-1"], "method.moves.reorient must be at least 0, got -1"),
    (["method.search.slack=x"], "method.search.slack must be a number, got 'x'"),
    (["method.search.restarts=0"], "method.search.restarts must be at least 1 and at most 1000, got 0"),
    (["method.maps=3", "method.at_most=4"], "not two"),
])
def test_hydra_says_it_with_the_same_words(words, message):
    with pytest.raises(InputError, match=message):
        composed(*words)


def test_parameters_do_not_change_and_copies_keep_the_rest():
    params = CollageParams().updated(moves={"root": 0}, births={"count": 20})
    assert params.moves.root == 0 and params.moves.birth == CollageParams().moves.birth
    assert params.births.count == 20 and isinstance(params, Params)
    with pytest.raises(ValueError, match="frozen"):
        params.moves.root = 1.0
