"""What contracts in a norm, on average or not at all, and the bounds that follow."""

import json
import os
import pickle
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch

from fractal_exp import IFS, InputError
from fractal_exp.ifs.attractor import (
    bounding_disc,
    normalize,
    random_points,
    support_function,
    visible_box,
    visible_tips,
)
from fractal_exp.ifs.contraction import AVERAGE, NEITHER, NORM
from fractal_exp.rendering.still import render_with_info

STATIC = Path(__file__).parents[2] / "fractal_exp" / "viewer" / "static"
TAKAGI = [[0.5, 0, 1, 0.5, 0, 0, 0.5], [0.5, 0, -1, 0.5, 0.5, 0.5, 0.5]]
HALF_TURN = [[0.5, -0.3, 0.3, 0.5, 1, 1, 0.5], [-1, 0, 0, -1, 0, 10, 0.5]]
STRETCH = [[0.2, -1, 0.3, 0.1, 0.4, -0.2, 0.55], [0.4, 0.3, -0.2, 0.5, -0.3, 0.1, 0.45]]
SWITCHED_OFF = [[1, 0, 0, 1, 0, 0, 0], [0.5, 0, 0, 0.5, 0, 0, 0.5], [0.5, 0, 0, 0.5, 0.5, 0, 0.5]]
SLOPES = [[0.3, 0, 50, 0.9, 0, 0, 0.5], [0.7, 0, -50, 0.9, 0.3, 50, 0.5]]  # fractal interpolation in unlike units


def code(rows) -> IFS:
    return IFS.from_json([list(map(float, row)) for row in rows])


def like_fractaldb(count: int, seed: int) -> list[IFS]:
    """Codes much like those of FractalDB: uniform entries, probabilities by the determinant; those that are not
    refused."""
    random, found = np.random.default_rng(seed), []
    while len(found) < count:
        maps = random.uniform(-1, 1, (random.integers(2, 8), 6)) * random.choice([0.6, 0.75, 1])
        drawn = IFS(maps[:, :4].reshape(-1, 2, 2), maps[:, 4:])
        found += [drawn] * (drawn.contraction.kind != NEITHER)
    return found


SAMPLE = like_fractaldb(60, 7)


def kind_of(each: IFS) -> str:
    how = each.contraction
    plain = " plainly" * np.array_equal(how.axes, np.eye(2))
    return how.kind if how.kind != NORM else how.kind + (" by words" if how.letters > 1 else plain)


def test_the_sample_has_codes_of_every_kind():
    assert {kind_of(each) for each in SAMPLE} == {"norm", "norm plainly", "norm by words", AVERAGE}


@pytest.mark.parametrize(("rows", "kind", "letters"), [
    (TAKAGI, NORM, 1), (STRETCH, NORM, 1), (SWITCHED_OFF, NORM, 1), (SLOPES, NORM, 1), (HALF_TURN, AVERAGE, 0),
    ([[3, 0, 0, 3, 0, 0, 0.3], [0.1, 0, 0, 0.1, 1, 1, 0.7]], AVERAGE, 0),
    ([[2, 0, 0, 0.1, 0, 0, 0.5], [0.1, 0, 0, 2, 0, 0, 0.5]], AVERAGE, 0),
    ([[0, 1e30, 0, 0, 0, 0]], NORM, 1), ([[1, 1, 0, 1, 0, 0]], NEITHER, 0), ([[1, 0, 0, 0.5, 0, 0]], NEITHER, 0),
    ([[0.6, -0.8, 0.8, 0.6, 0, 0]], NEITHER, 0), ([[3, 0, 0, 3, 0, 0, 0.9], [0.1, 0, 0, 0.1, 1, 1, 0.1]], NEITHER, 0),
])
def test_codes_are_of_the_kind_that_follows_by_hand(rows, kind, letters):
    how = IFS(*parts([[*row, 1][:7] for row in rows])).contraction
    assert (how.kind, how.letters) == (kind, letters)


def spectral_radii(linear: np.ndarray, letters: int) -> float:
    """The largest spectral radius of the words of up to so many letters."""
    words, largest = np.eye(2)[None], 0.0
    for _ in range(letters):
        words = (words[:, None] @ linear).reshape(-1, 2, 2)
        largest = max(largest, float(np.abs(np.linalg.eigvals(words)).max()))
    return largest


@pytest.mark.parametrize("number", range(len(SAMPLE)))
def test_a_norm_is_shown_by_words_that_contract_and_refuted_by_one_that_does_not(number):
    each = SAMPLE[number]
    linear, how = each.linear.double().numpy(), each.contraction
    if how.kind == AVERAGE:
        assert spectral_radii(linear, 4) >= 1
        return
    assert spectral_radii(linear, 4) < 1
    words, _ = how.words
    sizes = np.linalg.norm(how.axes @ words @ np.linalg.inv(how.axes), 2, axis=(1, 2))
    assert sizes.max() == pytest.approx(how.factor, rel=1e-12) and how.factor < 1
    assert complete(words, linear, how.letters)


def complete(words: np.ndarray, linear: np.ndarray, letters: int) -> bool:
    """Whether every word of so many letters begins with one of these, which are told apart by their matrices."""
    known, open_words = {(word.round(12) + 0.0).tobytes() for word in words}, np.eye(2)[None]
    for _ in range(letters):
        longer = (open_words[:, None] @ linear).reshape(-1, 2, 2)
        left = [word for word in longer if (word.round(12) + 0.0).tobytes() not in known]
        open_words = np.array(left).reshape(-1, 2, 2)
    return len(open_words) == 0


@pytest.mark.parametrize("number", range(0, len(SAMPLE), 5))
def test_the_exponent_is_that_of_long_products(number):
    each = SAMPLE[number]
    linear, chance = each.linear.double().numpy(), each.sampling_probabilities().double().numpy()
    random = np.random.default_rng(number)
    vectors, growth, runs, steps = np.tile([1.0, 0.3], (2000, 1)), np.zeros(2000), 2000, 300
    for step in range(steps + 50):
        vectors = np.einsum("kij,kj->ki", linear[random.choice(len(chance), runs, p=chance / chance.sum())], vectors)
        lengths = np.linalg.norm(vectors, axis=1)
        vectors /= lengths[:, None]
        growth += np.log(lengths) * (step >= 50)
    mean, noise = growth.mean() / steps, 4 * growth.std() / steps / runs**0.5
    how = each.contraction
    assert how.exponent - how.error - noise - 1e-3 < mean < how.exponent + noise + 1e-3 and how.error < 0.2


@pytest.mark.parametrize("rows", [TAKAGI, STRETCH, HALF_TURN, SLOPES], ids=["takagi", "stretch", "turn", "slopes"])
def test_bounds_hold_every_point_of_the_cases(rows):
    hold_every_point(code(rows))


@pytest.mark.parametrize("number", range(0, len(SAMPLE), 3))
def test_bounds_hold_every_point_of_the_sample(number):
    hold_every_point(SAMPLE[number])


def hold_every_point(each: IFS):
    """Or all but a ten thousandth, where nothing can."""
    points, heights = random_points(each, 50_000, seed=1)[0], support_function(each)
    certain, (center, radius) = each.contraction.kind == NORM, bounding_disc(each)
    most = 0 if certain else 5
    outside = (np.linalg.norm(points - center, axis=1) > radius).sum()
    assert outside <= most, f"{outside} of 50 000 points lie outside the disc, at most {most} may"
    angle = np.arange(len(heights)) * (2 * np.pi / len(heights))
    beyond = points @ np.stack([np.cos(angle), np.sin(angle)]) > heights + 1e-9 * radius
    assert beyond.any(1).sum() <= most, f"{beyond.any(1).sum()} of 50 000 points lie beyond a support line"


def test_the_bounds_of_takagis_curve_are_its_own():
    heights = support_function(code(TAKAGI))
    quarter = len(heights) // 4
    np.testing.assert_allclose(heights[::quarter], [1, 1, 0, 1], atol=1e-5)
    np.testing.assert_allclose(visible_box(code(TAKAGI)), [0, -1, 1, 1], atol=2e-3)
    assert bounding_disc(code(TAKAGI))[1] < 100


@pytest.mark.parametrize("rows", [STRETCH, SLOPES], ids=["stretch", "slopes"])
def test_the_bounds_are_not_much_farther_than_the_points(rows):
    points, heights = random_points(code(rows), 50_000, seed=1)[0], support_function(code(rows))
    sides = heights[:: len(heights) // 4]
    np.testing.assert_allclose(sides[:2] + sides[2:], np.ptp(points, axis=0), rtol=0.2)


def test_where_all_singular_values_are_below_1_the_disc_is_that_of_the_maps():
    for each in SAMPLE:
        if kind_of(each) == "norm plainly":
            linear, offset = each.linear.double().numpy(), each.offset.double().numpy()
            fixed = np.linalg.solve(np.eye(2) - linear, offset[..., None])[..., 0]
            scale = np.linalg.norm(linear, ord=2, axis=(1, 2))
            middle = np.average(fixed, axis=0, weights=1 / (1 - scale))
            moved = np.linalg.norm(np.einsum("nij,j->ni", linear, middle) + offset - middle, axis=1)
            center, radius = bounding_disc(each)
            assert np.array_equal(center, middle) and radius == (moved / (1 - scale)).max()


def test_a_map_that_is_never_chosen_does_not_count():
    off, without = code(SWITCHED_OFF), code(SWITCHED_OFF[1:])
    assert bounding_disc(off)[1] == bounding_disc(without)[1]
    assert np.array_equal(support_function(off), support_function(without))
    assert np.array_equal(visible_box(off), visible_box(without))
    expanding = code([[3, 0, 0, 3, 0, 0, 0], *SWITCHED_OFF[1:]])
    assert np.array_equal(support_function(expanding), support_function(without))


@pytest.mark.parametrize(("rows", "message"), [
    ([[1, 0, 0, 0.5, 0, 0, 1]], "map 1 has singular value 1;"),
    ([[1.1, 0, 0, 1.2, 0, 0, 0.9], [0.5, 0, 0, 0.9, 0, 0, 0.1]], "is 0.154, since map 1 has singular value 1.2;"),
    ([[9, 0, 0, 9, 0, 0, 0], [0.5, 0, 0, 0.5, 0, 0, 0.2], [2, 0, 0, 1, 0, 0, 0.8]], "is 0.416, since map 3 has .* 2;"),
])
def test_a_code_that_expands_is_refused_by_exponent_and_map(rows, message):
    for function in (bounding_disc, support_function, visible_box, normalize, random_points):
        with pytest.raises(InputError, match=message):
            function(IFS(*parts(rows)), *([5] * (function is random_points)))


def parts(rows):
    table = torch.tensor(rows, dtype=torch.float64)
    return table[:, :4].reshape(-1, 2, 2), table[:, 4:6], table[:, 6]


def test_a_measure_with_tails_is_framed_by_quantiles():
    tails = code([[3, 0, 0, 3, 0, 0, 0.3], [0, 0, 0, 0, 1, -1, 0.7]])  # 3^k (1, -1) with chance 0.7 · 0.3^k
    assert tails.contraction.kind == AVERAGE
    np.testing.assert_allclose(visible_box(tails), [1, -243, 243, -1])  # 0.3^5 = 0.0024, 0.3^6 = 0.0007
    x0, y0, x1, y1 = visible_box(normalize(tails))
    assert max(x1 - x0, y1 - y0) == pytest.approx(1.5, abs=1e-3)
    with pytest.raises(InputError, match="contracts on average only, so no word reaches farthest"):
        visible_tips(tails)


def test_a_code_remembers_how_it_contracts_and_can_be_sent_elsewhere():
    takagi = code(TAKAGI)
    assert takagi.contraction is takagi.contraction
    again = pickle.loads(pickle.dumps(takagi))
    assert again == takagi and again.contraction.factor == takagi.contraction.factor


@pytest.mark.skipif(not shutil.which("node"), reason="node runs the page's modules")
def test_a_page_finds_the_same():
    cases = [*SAMPLE[::2], *map(code, (TAKAGI, STRETCH, HALF_TURN, SWITCHED_OFF, SLOPES)),
             IFS(*parts([[2, 0, 0, 1, 0, 0, 1]]))]
    script = f"""
import {{ chancesOf, ready }} from "{STATIC.as_uri()}/code.mjs";
import {{ contractionOf, exponentOf }} from "{STATIC.as_uri()}/contraction.mjs";
import {{ boundingRectangle, boxOf }} from "{STATIC.as_uri()}/hull.mjs";
const codes = JSON.parse(process.argv[1]);
console.log(JSON.stringify(codes.map(([rows, probabilities]) => {{
  const chances = chancesOf(rows, probabilities), {{ kind, letters, factor }} = contractionOf(rows, chances);
  const chosen = rows.filter((_, i) => chances[i] > 0), own = chances.filter((chance) => chance > 0);
  if (kind === "neither") return [kind, letters, factor, exponentOf(chosen, own), null];
  const {{ x, y, hx, hy }} = boxOf({{ rows, probabilities }});
  boundingRectangle(ready({{ rows, probabilities }}));
  return [kind, letters, factor, exponentOf(chosen, own), [x - hx, y - hy, x + hx, y + hy]];
}})));
"""
    given = [(torch.cat([each.linear.flatten(1), each.offset], 1).tolist(),
              None if each.probabilities is None else each.probabilities.tolist()) for each in cases]
    run = subprocess.run(["node", "--input-type=module", "-e", script, json.dumps(given)], check=True, text=True,
                         capture_output=True)
    for each, (kind, letters, factor, exponent, box) in zip(cases, json.loads(run.stdout), strict=True):
        how = each.contraction
        assert (kind, letters) == (how.kind, how.letters) and factor == pytest.approx(how.factor, rel=1e-4)
        assert exponent == pytest.approx(how.exponent, abs=how.error + 0.05)
        if kind != NEITHER:
            low, high = np.quantile(random_points(each, 20_000, seed=2)[0], (0.01, 0.99), axis=0)
            assert (np.array(box[:2]) <= low).all() and (np.array(box[2:]) >= high).all()


@pytest.mark.skipif("FRACTAL_EXP_FRACTALDB" not in os.environ,
                    reason="FRACTAL_EXP_FRACTALDB names no .npz with the codes of FractalDB-1k: rows (1000,7,7)")
def test_all_codes_of_fractaldb_are_taken_and_drawn():
    kinds = []
    for rows in np.load(os.environ["FRACTAL_EXP_FRACTALDB"])["rows"]:
        each = code(rows[~np.isnan(rows[:, 0])])
        kinds.append(kind_of(each).split(" by")[0])
        image, info = render_with_info(normalize(each), resolution=64, points_in_view=5000, supersample=1)
        assert info.reason is None and info.mass > 0.9 and int((image > 0).sum()) > 30
    assert [kinds.count(kind) for kind in ("norm plainly", "norm", AVERAGE)] == [134, 704, 162]
