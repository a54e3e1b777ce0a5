"""docs/deviations.md says how this differs from the paper: every setting in its tables is that of the configuration,
and no setting of the method is left out."""

import re

import pytest
import yaml
from configured import ABLATIONS, plain
from omegaconf import OmegaConf
from places import ROOT

PAGE = (ROOT / "docs" / "deviations.md").read_text()
SCALES = sorted((ROOT / "conf" / "scale").glob("*.yaml"))
NO_DEVIATION = {  # of the machine, not of the method
    "model.resolution", "model.backend", "optimizer.cuda_graph", "loss.terms.perceptual.weights", "evaluation.device",
    "method.device", "method.previews", "method.seconds", "method.seed",
}
REPEATED = ("method.model.", "method.objective.", "method.optimizer.")  # by the method's interpolations


def tables():
    """Every table of the page: its header, and its rows as lists of cells."""
    found = []
    for block in re.findall(r"(?:^\|.*\n)+", PAGE, re.MULTILINE):
        lines = [[cell.strip() for cell in line.strip("|\n").split("|")] for line in block.splitlines()]
        assert all(len(line) == len(lines[0]) for line in lines), f"cells are missing: {lines[0]}"
        found.append((lines[0], lines[2:]))
    return found


def options(cell):
    """The settings `key=value` of a cell, as YAML reads them."""
    return {key: yaml.safe_load(value) for key, value in re.findall(r"`([\w.]+)=([^`]*)`", cell)}


def stated(column):
    """(name of the row, its settings) of every row of the tables that have this column."""
    return [(row[0], options(row[head.index(column)])) for head, rows in tables() if column in head for row in rows]


def has(config, key, value):
    config = OmegaConf.create(config)
    assert OmegaConf.select(config, key, default="absent") != "absent", f"there is no {key}"
    assert OmegaConf.to_container(OmegaConf.create({"": OmegaConf.select(config, key)}))[""] == value, key


def leaves(config, prefix):
    node = OmegaConf.select(OmegaConf.create(config), prefix)
    if not OmegaConf.is_dict(node):
        return {prefix}
    return {leaf for key in node for leaf in leaves(config, f"{prefix}.{key}")}


def test_every_option_is_what_the_page_says_at_the_scale_of_the_paper():
    config = plain("scale=paper", "target=suite")
    settings = [(row, key, value) for row, found in stated("option") for key, value in found.items()]
    assert len(settings) > 30
    for _, key, value in settings:
        has(config, key, value)


def test_no_setting_of_the_method_or_of_its_evaluation_is_left_out():
    config = plain("scale=paper", "target=suite")
    named = {key for _, found in stated("option") for key in found}
    groups = "method", "model", "loss", "optimizer", "evaluation"
    mine = {leaf for group in groups for leaf in leaves(config, group) if not leaf.startswith(REPEATED)}
    missing = {leaf for leaf in mine - named - NO_DEVIATION if "_target_" not in leaf}
    top_level = {"loss.terms.perceptual.kind": "perceptual"}  # named by the key that it repeats
    assert {leaf for leaf in missing if top_level.get(leaf, leaf.removeprefix("method.")) not in named} == set()


def test_every_ablation_is_there_and_is_what_the_page_says():
    rows = {row.strip("`"): found for row, found in stated("here: option")}
    assert set(rows) == set(ABLATIONS)
    for name, found in rows.items():
        config, full = plain("scale=paper", f"ablation={name}"), plain("scale=paper")
        assert found, name
        for key, value in found.items():
            has(config, key, value)
            assert OmegaConf.select(OmegaConf.create(full), key) != value, f"{key} is no difference"


def test_a_preset_sets_what_the_page_says_and_nothing_else():
    rows = dict(stated("sets"))
    written, released, ours = (rows[f"`chaotic_{name}`"] for name in ("written", "released", "ours"))
    for name, sets in {"written": written, "released": released, "ours": ours}.items():
        for scale in ("laptop", "paper"):
            config = plain(f"scale={scale}", f"method=chaotic_{name}")
            for key, value in sets.items():
                has(config, key, value)
    plainly, config = plain("method=chaotic_written"), plain("method=chaotic_released")
    groups = "method", "model", "loss", "optimizer"
    changed = {leaf for group in groups for leaf in leaves(config, group) if not leaf.startswith(REPEATED)
               if OmegaConf.select(OmegaConf.create(config), leaf)
               != OmegaConf.select(OmegaConf.create(plainly), leaf)}
    assert changed == {key for key in written | released if written.get(key) != released.get(key)}


@pytest.mark.parametrize("path", SCALES, ids=lambda path: path.stem)
def test_every_difference_between_the_scales_is_there(path):
    head, rows = next((head, rows) for head, rows in tables() if "`scale=laptop`" in head)
    column = head.index(f"`scale={path.stem}`")
    config = plain(f"scale={path.stem}")
    said = {row[0].strip("`"): yaml.safe_load(row[column]) for row in rows}
    for key, value in said.items():
        has(config, key, value)
    anywhere = {*said, *(key for _, found in stated("option") for key in found)}
    sets = yaml.safe_load(path.read_text())
    assert {leaf for key in sets for leaf in leaves(sets, key)} - {"scale"} <= anywhere
