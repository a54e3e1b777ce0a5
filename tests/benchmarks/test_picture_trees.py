"""The trees of the picture sets: their true codes, their grammars, and the random ones."""

import numpy as np
import pytest

from benchmarks.pictures import trees
from benchmarks.pictures.sets import SETS
from fractal_exp import IFS
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import read_target


@pytest.mark.parametrize("name", ["plant_5_jpeg", "lean_7", "thin_8"])
def test_the_true_code_of_a_tree_is_recovered_and_one_without_its_trunk_is_not(name):
    read = read_target(trees.trees()[name].source(name), 128)
    true = trees.truth(name, read).code
    scores = trees.score(name, true, read)
    assert scores["recovered"] and scores["missed"] == 0 and scores["true_maps"] == len(true)
    bare = IFS(true.linear[:-1], true.offset[:-1])
    assert trees.score(name, bare, read)["missed"] >= 1
    assert SETS["trees"].truth(name, read).linear.equal(true.linear)


@pytest.mark.parametrize("name", [*trees.trees(), *trees.random_trees()])
def test_the_trunk_of_a_true_code_is_the_one_that_is_drawn(name):
    tree = trees.named(name)
    code = tree.code()
    reach = attractor.support_function(code)    # up is a quarter of a turn, down three quarters
    low, high = -reach[3 * len(reach) // 4], reach[len(reach) // 4]
    drawn = [[complex(*(linear[:, 1] * end + offset).tolist()) for end in (low, high)]
             for linear, offset in zip(code.linear[len(tree.copies):], code.offset[len(tree.copies):], strict=True)]
    assert np.array(drawn) == pytest.approx(np.array(tree.trunk), abs=1e-4)


def _written(axiom, rules, steps, angle):
    """The ends (S,2) of the segments F that a turtle draws of an L-system, upwards from 0."""
    for _ in range(steps):
        axiom = "".join(rules.get(letter, letter) for letter in axiom)
    place, heading, kept, drawn = 0j, 1j, [], []
    for letter in axiom:
        if letter == "F":
            drawn.append((place, place + heading))
            place += heading
        elif letter in "+-":
            heading *= np.exp(1j * np.radians(angle if letter == "+" else -angle))
        elif letter == "[":
            kept.append((place, heading))
        elif letter == "]":
            place, heading = kept.pop()
    return np.array(drawn)


@pytest.mark.parametrize("name, rule, angle", [("plant_4", "F+[[X]-X]-F[-FX]+X", 25),
                                               ("weed_5", "F[+X][-X]FX", 25.7), ("herb_6", "F[+X]F[-X]+X", 20)])
def test_plants_are_those_of_their_grammar(name, rule, angle):
    tree = trees.trees()[name]
    written = _written("X", {"X": rule, "F": "FF"}, tree.depth + 1, angle) / 2**tree.depth
    lines = np.concatenate(tree.steps()) @ [1, 1j]
    assert np.abs(lines[:, 1] - lines[:, 0]).sum() == pytest.approx(np.abs(written[:, 1] - written[:, 0]).sum())
    for part in (np.real, np.imag):
        assert (part(lines).min(), part(lines).max()) == pytest.approx((part(written).min(), part(written).max()))
