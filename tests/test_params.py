"""The parameters of collage search: each is documented, reached by Hydra, checked, and every part can be left out."""

from pathlib import Path

import fractal_exp.conf
import pytest
import torch
import yaml
from collage_helpers import image_search, small, tied
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from fractal_exp import InputError
from fractal_exp.cli import configuration
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.image.moves import MOVES
from fractal_exp.methods.collage.params import CollageParams, hydra_config
from fractal_exp.runtime.params import Params

CONF = Path(next(iter(fractal_exp.conf.__path__)))
PARTS = sorted(path.stem for path in (CONF / "without").glob("*.yaml"))
FULL = "nothing"


configuration.register()


def composed(*words: str) -> dict:
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        return OmegaConf.to_container(configuration.resolve(compose("train", ["method=collage", *words])))


def leaves(node: dict, prefix: str = "") -> dict:
    return {key: value for name, inner in node.items() for key, value in (
        leaves(inner, f"{prefix}{name}.") if isinstance(inner, dict) else {f"{prefix}{name}": inner}).items()}


def test_hydra_has_every_parameter_with_its_docstring():
    assert (CONF / "method" / "collage.yaml").read_text() == hydra_config(), (
        "python -m fractal_exp.methods.collage.params > conf/method/collage.yaml")
    settings = leaves(composed()["method"])
    for name, info in CollageParams.leaves():
        assert info.description, name
        assert name in settings, name


def test_what_a_scale_may_set_is_by_default_what_the_parameters_say():
    given, default = composed()["method"], CollageParams()
    search, moves = default.search, default.moves
    assert (given["rounds"], given["moves"]["count"]) == (default.rounds, moves.count)
    assert [given["search"][name] for name in ("restarts", "moves", "detail_moves")] == [
        search.restarts, search.moves, search.detail_moves]


@pytest.mark.parametrize("part", PARTS)
def test_leaving_a_part_out_changes_the_parameters_that_it_names_and_nothing_else(part):
    text = yaml.safe_load((CONF / "without" / f"{part}.yaml").read_text()) or {}
    changed, full = leaves(composed(f"without={part}")), leaves(composed())
    different = {name for name in full if full[name] != changed[name]}
    assert different == {name for name in leaves(text)}
    assert changed["variant"] == ("full" if part == FULL else f"without_{part}")


@pytest.mark.parametrize("part", PARTS)
def test_a_search_without_a_part_ends_with_a_code(part, triangle):
    options = (yaml.safe_load((CONF / "without" / f"{part}.yaml").read_text()) or {}).get("method", {})
    code = small(**options).reconstruct(torch.nn.functional.avg_pool2d(triangle[1][None], 2)[0]).code
    assert len(code) >= 2


def test_every_move_has_odds_of_its_own():
    assert set(MOVES) <= set(type(CollageParams().moves).model_fields)


def test_no_move_is_made_where_all_are_switched_off(triangle):
    search = image_search(triangle[1], moves=dict.fromkeys(MOVES, 0.0))
    now = search.judged(tied(affine.from_code(triangle[0])))
    assert search.step(now, 0) is now


@pytest.mark.parametrize(("options", "message"), [
    ({"moves": {"reorient": -1}}, "moves.reorient must be at least 0.0, got -1"),
    ({"moves": {"reorient": float("nan")}}, "moves.reorient must be a finite number, got nan"),
    ({"moves": {"reorint": 1}}, "there is no parameter moves.reorint; did you mean 'reorient'"),
    ({"search": {"slack": 1.0}}, "search.slack must be below 1.0, got 1.0"),
    ({"search": {"restarts": 2.5}}, "search.restarts must be a whole number, got 2.5"),
    ({"search": {"mix": {"largest": 1.2}}}, "search.mix.largest must be below 1.0, got 1.2"),
    ({"births": {"large": [0.1]}}, "births.large.1 is needed"),
    ({"frame": {"enabled": "yes"}}, "frame.enabled must be true or false, got 'yes'"),
    ({"levels": "colour"}, "levels must be 'auto', 'density', 'coverage' or 'binary', got 'colour'"),
    ({"saturation": 3}, "saturation must be a mapping of settings, got 3"),
    ({"maps": 3, "at_most": 4}, "give the number of maps or its upper bound, not both"),
])
def test_a_parameter_out_of_range_is_refused_by_its_full_name(options, message):
    with pytest.raises(InputError, match="^" + message.replace("(", "\\(")):
        CollageParams().updated(**options)


@pytest.mark.parametrize(("words", "message"), [
    (["method.moves.reorient=-1"], "method.moves.reorient must be at least 0.0, got -1"),
    (["method.search.slack=x"], "method.search.slack must be a number, got 'x'"),
    (["restarts=0"], "method.search.restarts must be at least 1, got 0"),
    (["method.maps=3", "method.at_most=4"], "not both"),
])
def test_hydra_says_it_with_the_same_words(words, message):
    with pytest.raises(InputError, match=message):
        composed(*words)


def test_parameters_do_not_change_and_copies_keep_the_rest():
    params = CollageParams().updated(moves={"root": 0}, births={"large": [0.3, 0.9]})
    assert params.moves.root == 0 and params.moves.birth == CollageParams().moves.birth
    assert params.births.large == (0.3, 0.9) and isinstance(params, Params)
    with pytest.raises(ValueError, match="frozen"):
        params.moves.root = 1.0
