import json

import pytest
from configured import ABLATIONS, composed, options, plain
from hydra.errors import HydraException
from omegaconf import OmegaConf

from fractal_exp import InputError
from fractal_exp.cli import configuration
from fractal_exp.runtime.checkpoint import compare


@pytest.mark.parametrize("group", ["target", "model", "loss", "optimizer", "scale", "tracking", "ablation", "init"])
def test_every_choice_composes_passes_its_schema_and_differs_from_the_others(group):
    composed = {}
    for choice in options(group):
        extra = ["target.path=leaf.png"] if (group, choice) == ("target", "image") else []
        composed[choice] = plain(f"{group}={choice}", *extra)
    assert len({json.dumps(each, sort_keys=True, default=str) for each in composed.values()}) == len(composed) > 1


def test_a_module_that_does_not_import_is_a_defect_and_no_name_that_is_not_there(tmp_path, monkeypatch):
    (tmp_path / "broken_model.py").write_text("import a_library_that_nobody_has\nclass Model: pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ImportError, match="a_library_that_nobody_has"):
        configuration.check_components(OmegaConf.create({"_target_": "broken_model.Model"}), "model")


def test_a_fit_that_begins_with_collage_search_has_one_start_and_a_name_of_its_own():
    config = plain("init=collage", "scale=smoke")
    assert config["method"]["starts"] == 1 and config["method"]["init"]["search"]["moves"] == 8
    assert configuration.method_name(config["method"]) == "collage-chaotic"
    assert configuration.method_name(plain()["method"]) == "chaotic"
    with pytest.raises(InputError, match="take method=chaotic"):
        plain("init=collage", "method=collage")


def test_every_ablation_is_listed_here():
    assert set(options("ablation")) == {*ABLATIONS, "none"}


@pytest.mark.parametrize("name", ABLATIONS)
@pytest.mark.parametrize("words", [
    (), ("method=chaotic_released",), *(pytest.param((word,), marks=pytest.mark.slow)
                                        for word in ("method=chaotic_written", "scale=paper"))], ids=" ".join)
def test_an_ablation_differs_from_the_full_method_by_what_it_names_alone(name, words):
    full, ablated = plain(*words), plain(*words, f"ablation={name}")
    full.pop("method"), ablated.pop("method")  # repeats model, loss and optimizer
    changed = {line.split(":")[0] for line in compare(full, ablated)}
    assert changed, "an ablation must change something"
    named = ABLATIONS[name] | ({"loss.weights.mse"} if name == "no_mip" else set())  # released, of one level it is 10
    for key in changed:
        assert any(key == part or key.startswith(part + ".") for part in named), key
    assert name == "moments" or ablated["loss"]["weights"]["mse"] in (10.0, full["loss"]["weights"]["mse"])


@pytest.mark.parametrize(("words", "variant"), [
    ([], "full"), (["ablation=none", "loss=full"], "full"), (["loss=no_mip"], "no_mip"),
    (["ablation=no_mip"], "no_mip"), (["ablation=no_annealing"], "no_annealing"), (["optimizer=gradient"], "gradient"),
    (["model=naive", "loss=no_mip"], "naive+no_mip"), (["ablation=no_annealing", "loss=no_ssim"],
                                                       "no_ssim+no_annealing"),
    (["ablation=no_ssim", "loss=no_mip"], "no_mip"), (["method=chaotic_released"], "as_released"),
    (["method=chaotic_written", "ablation=no_mip"], "as_written+no_mip"),
    (["method=chaotic_released", "loss=full"], "as_released+full"), (["method=collage"], "full")], ids=str)
def test_a_variant_is_named_by_what_was_chosen(words, variant, hydra_composed):
    config = composed(*words, hydra=True)
    hydra_composed(config)
    assert config.variant == variant


def test_method_chaotic_is_ours_at_the_scale_of_a_laptop():
    assert plain("scale=laptop", "method=chaotic_ours")["method"] == plain("scale=laptop")["method"]


def test_the_appendix_is_what_method_chaotic_leaves_out_at_the_scale_of_the_paper():
    plainly, written = (plain("scale=paper", f"method={name}")["method"] for name in ("chaotic", "chaotic_written"))
    written["optimizer"] |= {"common_random_numbers": True, "energy_before_step": False}
    written["objective"]["terms"]["mse"]["summed"] = False
    assert written | {"result": "best"} == plainly


@pytest.mark.parametrize("name", ["written", "released"])
def test_annealing_alone_draws_new_points_where_the_method_does(name):
    assert plain(f"method=chaotic_{name}", "ablation=no_gradients")["optimizer"]["common_random_numbers"] is False
    assert plain("method=chaotic", "ablation=no_gradients")["optimizer"]["common_random_numbers"] is True


@pytest.mark.parametrize("scale", ["laptop", "paper"])
def test_the_released_annealing_has_no_phase_where_the_first_half_ends(scale):
    config = plain(f"scale={scale}", "method=chaotic_released")
    total, every, until = config["iterations"], config["optimizer"]["every"], config["optimizer"]["until"]
    ends = range(every, total + 1, every)
    assert [end for end in ends if (end - 1) / total < until] == [end for end in ends if end < total / 2]


def test_your_own_words_win_over_a_preset():
    method = plain("method=chaotic_written", "starts=5", "match_target=true")["method"]
    assert method["starts"] == 5 and method["match_target"] is True
    assert plain("method=chaotic_ours", "init=collage")["method"]["starts"] == 1


def test_parts_of_the_method_compose():
    both = plain("model=naive", "loss=no_mip", "optimizer=gradient")
    assert both["loss"]["terms"]["mse"]["levels"] == 1 and both["loss"]["weights"]["mse"] == 10
    assert both["loss"]["weights"]["regularizer"] == .1, "naive maps need the regulariser"
    assert plain("model=naive", "loss=no_regularizer")["loss"]["weights"]["regularizer"] == 0
    assert plain("model=no_multisampling")["loss"] == plain()["loss"]
    released = plain("method=chaotic_released", "ablation=no_mip", "optimizer=gradient")
    assert released["model"]["parameterization"]["_target_"].endswith("released.QR")
    assert released["loss"]["terms"]["mse"]["levels"] == 1 and "Descent" in released["optimizer"]["_target_"]


def test_the_librarys_defaults_are_those_of_the_laptop_scale():
    from hydra.utils import instantiate

    from fractal_exp.methods.chaotic.method import laptop

    ours, configured = laptop(), instantiate(configuration.resolve(composed("scale=laptop")).method)

    def plain_numbers(thing):
        return {name: value if isinstance(value, int | float | str | tuple | None) else plain_numbers(value)
                for name, value in vars(thing).items() if name not in ("objective", "parameterization")}

    assert plain_numbers(ours) == plain_numbers(configured)


def test_the_command_line_wins_over_scale_and_ablation():
    config = plain("scale=smoke", "ablation=no_multisampling", "iterations=7", "model.sigma_px=1.5")
    assert config["iterations"] == 7 and config["method"]["iterations"] == 7 and config["model"]["sigma_px"] == 1.5


def test_paths_are_absolute(folder):
    config = plain("target=image", "target.path=leaf.png")
    assert config["target"]["path"] == str(folder / "leaf.png") and config["output"] == str(folder / "outputs")


@pytest.mark.parametrize(("overrides", "message"), [
    (["model.maps=many"], "model.maps: .*got 'many'"),
    (["model.sigma_px=wide"], "model.sigma_px: .*got 'wide'"),
    (["optimizer.annealing.spread=x"], "optimizer.annealing.spread: .*got 'x'"),
    (["target.kind=color"], "target.kind: Input should be 'grey' or 'binary', got 'color'"),
    (["+model.layers=3"], "model.layers: .*not permitted; ForwardModel takes parameterization, resolution, maps"),
    (["target=image"], "no value was given for target.path; add picture=FILE"),
])
def test_wrong_keys_and_types_are_refused_by_name(overrides, message):
    with pytest.raises(InputError, match=message):
        configuration.resolve(composed(*overrides))


@pytest.mark.parametrize("override", ["model.layers=3", "resolution=big", "seed=x", "target=nothing", "colour=red"])
def test_hydra_refuses_what_it_can_see_itself(override):
    with pytest.raises(HydraException):
        composed(override)
