import json
import math
import os
from dataclasses import replace

import pytest
import torch

import fractal_exp
from fractal_exp import IFS, Colours, InputError, View
from fractal_exp.runtime.files import read_json

HALF = [[0.5, 0.0], [0.0, 0.5]]


def triangle(**kwargs) -> IFS:
    return IFS([HALF] * 3, [[0, 0], [0.5, 0], [0.25, 0.5]], **kwargs)


def test_a_code_is_float32_and_a_copy():
    linear = torch.eye(2, dtype=torch.float64)[None] / 2
    code = IFS(linear, [[1, 2]])
    linear.zero_()
    assert code.linear.dtype == code.offset.dtype == torch.float32
    assert len(code) == 1 and torch.equal(code.linear[0], torch.eye(2) / 2)
    with pytest.raises(AttributeError):
        code.linear = linear


@pytest.mark.parametrize(("linear", "offset", "probabilities", "message"), [
    ([[0.5, 0.0]], [[0, 0]], None, r"linear must have shape \(N, 2, 2\)"),
    (torch.zeros(0, 2, 2), torch.zeros(0, 2), None, "N >= 1"),
    ([HALF], [[0, 0], [1, 1]], None, r"offset must have shape \(1, 2\)"),
    ([HALF], [[math.nan, 0]], None, "offset must be finite"),
    ([[[0.5, 0], [0]]], [[0, 0]], None, "linear must be a regular array"),
    ([HALF] * 2, [[0, 0]] * 2, [1.0], r"probabilities must have shape \(2,\)"),
    ([HALF] * 2, [[0, 0]] * 2, [1.5, -0.5], "must not be negative, got -0.5"),
    ([HALF] * 2, [[0, 0]] * 2, [0.5, 0.2], "must sum to 1, got 0.7"),
])
def test_unusable_parameters_are_refused(linear, offset, probabilities, message):
    with pytest.raises(InputError, match=message):
        IFS(linear, offset, probabilities)


@pytest.mark.parametrize(("center", "zoom", "message"), [
    ((0, 0), 0, "zoom must be a finite number above 0"), ((0, 0), -1, "zoom"), ((0, 0), math.nan, "zoom"),
    ((0, 0), math.inf, "zoom"), ((math.nan, 0), 1, "center must be finite"), ((0,), 1, "needs center"),
    ((0, 0), "big", "needs center"),
])
def test_unusable_views_are_refused(center, zoom, message):
    with pytest.raises(InputError, match=message):
        View(center, zoom)


def test_a_view_is_a_window_of_half_side_one_over_zoom():
    assert View().box == (-1, -1, 1, 1)
    assert View((0.5, -0.25), 4).box == (0.25, -0.5, 0.75, 0.0)


def test_sampling_probabilities_follow_the_determinants_unless_given():
    code = IFS([HALF, [[0.3, 0], [0, -0.1]]], [[0, 0], [0, 0]])
    expected = torch.tensor([0.26, 0.04]) / 0.30
    torch.testing.assert_close(code.sampling_probabilities(), expected)
    assert torch.equal(triangle(probabilities=[0.5, 0.25, 0.25]).sampling_probabilities(),
                       torch.tensor([0.5, 0.25, 0.25]))


def test_a_map_that_does_not_contract_is_named():
    code = IFS([HALF, [[2.9, 0.9], [0, 2.9]]], [[0, 0], [0, 0]])
    with pytest.raises(InputError, match=r"must be below -0.0001 and is 1.02, since map 2 has singular value 3.38471;"):
        code.check_contractive()
    assert triangle().check_contractive() is not None


def test_a_similar_code_maps_the_moved_points_alike():
    generator = torch.Generator().manual_seed(0)
    code = IFS(torch.rand(4, 2, 2, generator=generator) - 0.5, torch.rand(4, 2, generator=generator))
    scale, shift = 1.7, (0.3, -0.6)
    x = torch.rand(2, generator=generator)
    moved = scale * x + torch.tensor(shift)
    there = torch.einsum("nij,j->ni", code.similar(scale, shift).linear, moved) + code.similar(scale, shift).offset
    here = scale * (torch.einsum("nij,j->ni", code.linear, x) + code.offset) + torch.tensor(shift)
    torch.testing.assert_close(there, here)


def test_both_public_spellings_are_read():
    rows = IFS.from_json([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.25], [0.5, 0, 0, 0.5, 0, 0, 0.75]])
    assert torch.equal(rows.linear[0], torch.tensor([[0.1, 0.2], [0.3, 0.4]]))
    assert torch.equal(rows.offset[0], torch.tensor([0.5, 0.6]))
    assert torch.equal(rows.probabilities, torch.tensor([0.25, 0.75]))
    assert IFS.from_json([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]]).probabilities is None
    for matrices in ([[0.1, 0.2, 0.3, 0.4]], [[[0.1, 0.2], [0.3, 0.4]]]):
        lists = IFS.from_json({"ifs_m": matrices, "ifs_t": [[0.5, 0.6]], "ifs_p": [1.0]})
        assert torch.equal(lists.linear, rows.linear[:1]) and torch.equal(lists.offset, rows.offset[:1])


CODE = {"format": "fractal-exp/ifs", "version": 1, "linear": [HALF], "offset": [[0, 0]]}


def written(**changes):
    return json.dumps({**CODE, **changes})


@pytest.mark.parametrize(("text", "message"), [
    ("[" * 100_000, "nested too deeply"),
    (written(linear=[[[1.5, 0], [0, 0.5]]]), "map 1 has singular value 1.5"),
    (written(extra=1), r"unknown keys \['extra'\]"),
    ('{"format": "fractal-exp/ifs", "version": 1, "linear": [[[0.5, 0], [0, 0.5]]]}', "has no offset"),
    ('{"ifs_m": [[[0.5, 0], [0, 0.5]]]}', "needs ifs_t"),
    ('{"ifs_m": [[[0.5, 0], [0, 0.5]]], "ifs_t": [[0, 0]], "note": ""}', "unknown keys"),
    ("[[0.5, 0, 0, 0.5, 0]]", "six numbers"),
    ("[[0.5, 0, 0, 0.5, 0, 0], [0.5]]", "regular array"),
    ('"fern"', "got str"),
    ("{", "is not JSON"),
    ('{"a": 1, "a": 2}', "gives the key 'a' twice"),
    (written(meta=[]), "meta holds free notes by name .a mapping., got list"),
    (written(version=2), "version 1, got 'fractal-exp/ifs' version 2; no other version is read"),
    (written(version=True), "version True"),
    (written(offset=[[True, 0]]), "offset must hold numbers only, got True"),
    (written(offset=[[float("nan"), 0]]), "offset must hold finite numbers up to 3.403e.38 .float32., got nan"),
    (written().replace("[[0, 0]]", "[[1e400, 0]]"), "offset must hold finite numbers .* got inf"),
    (written().replace("[[0, 0]]", "[[1e39, 0]]"), "offset must hold finite numbers .* got 1e.39"),
    (written().replace("[[0, 0]]", f"[[{'9' * 4000}, 0]]"), "has a number of 4000 digits, at most 308 are read"),
    (written(probabilities=[True]), "probabilities must hold numbers only"),
    ('{"ifs_m": [[0.5, 0, 0, 0.5]], "ifs_t": [[false, 0]]}', "ifs_t must hold numbers only, got False"),
])
def test_a_damaged_or_crafted_code_is_refused_in_one_short_line(tmp_path, text, message):
    path = tmp_path / "code.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=message) as error:
        IFS.load(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)
    assert len(str(error.value)) < len(str(path)) + 400


def test_a_code_file_is_not_read_if_it_is_huge_or_no_file(tmp_path):
    for name in ("huge.json", "huge.flame"):
        with open(tmp_path / name, "wb") as file:
            file.truncate(10 * 2**30)  # takes no room on the disk
        with pytest.raises(InputError, match="it has 10737418240 bytes, at most 16777216 are read"):
            IFS.load(tmp_path / name)
    os.mkfifo(tmp_path / "pipe.json")
    for path, kind in ((tmp_path / "pipe.json", "pipe"), ("/dev/zero", "device"), (tmp_path, "folder")):
        with pytest.raises(InputError, match=f"cannot read the code .* it is a {kind}"):
            IFS.load(path)
    with pytest.raises(InputError, match="cannot read the code .*No such file"):
        IFS.load(tmp_path / "none.json")
    with pytest.raises(InputError, match="File name too long"):
        IFS.load(tmp_path / ("x" * 300))
    with pytest.raises(InputError, match="null byte"):
        read_json("a\0b", "it")


def test_codes_are_equal_by_value_and_equal_codes_have_one_hash():
    code = triangle(probabilities=[0.5, 0.25, 0.25], meta={"name": "a"}, colours=Colours([[1, 0, 0]] * 3, [1, 1, 1]))
    same = IFS(code.linear.clone(), code.offset, code.probabilities, dict(code.meta),
               Colours(code.colours.rgb, code.colours.blends))
    assert code == same and hash(code) == hash(same) and code.to("cpu") == code and len({code, same}) == 1
    for other in (replace(code, meta={}), replace(code, probabilities=None), replace(code, colours=None),
                  replace(code, offset=code.offset + 1e-6), triangle(), triangle().similar(2, (0, 0)), "a code"):
        assert code != other
    assert IFS([HALF], [[0.0, 0]]) == IFS([HALF], [[-0.0, 0]]) and hash(IFS([HALF], [[0.0, 0]])) == hash(
        IFS([HALF], [[-0.0, 0]])), "zeros of either sign are equal"


def test_maps_can_be_gone_through():
    code = triangle()
    maps = [(linear.tolist(), offset.tolist()) for linear, offset in code]
    assert maps == [(HALF, [0, 0]), (HALF, [0.5, 0]), (HALF, [0.25, 0.5])] and len(maps) == len(code)


def test_a_contracted_code_has_the_nearest_matrices_that_contract():
    rotation = torch.tensor([[0.6, -0.8], [0.8, 0.6]])
    code = IFS(torch.stack([rotation @ torch.diag(torch.tensor([2.0, 0.3])), torch.tensor(HALF)]), [[1, 2], [3, 4]])
    near = code.contracted(0.9)
    torch.testing.assert_close(near.linear[0], rotation @ torch.diag(torch.tensor([0.9, 0.3])))
    assert torch.equal(near.linear[1], code.linear[1]) and torch.equal(near.offset, code.offset)
    assert code.contracted().check_contractive() == code.contracted()
    distance = (near.linear[0] - code.linear[0]).norm()
    generator = torch.Generator().manual_seed(0)
    for _ in range(200):
        other = IFS(near.linear[:1] + 0.05 * torch.randn(1, 2, 2, generator=generator), [[0, 0]])
        if float(other.singular_values().max()) <= 0.9:
            assert (other.linear[0] - code.linear[0]).norm() >= distance - 1e-6
    for most in (0, 1, -1, math.nan, "x"):
        with pytest.raises(InputError, match="most must be a number above 0 and at most 0.999"):
            code.contracted(most)


def test_whole_numbers_of_any_length_are_numbers():
    assert float(IFS([HALF], [[10**38, 0]]).offset[0, 0]) == pytest.approx(1e38)
    with pytest.raises(InputError, match="offset must be a regular array of numbers"):
        IFS([HALF], [[10**400, 0]])
    with pytest.raises(InputError, match="rows must hold finite numbers up to .*, got an integer of more than 20"):
        IFS.from_json([[0.5, 0, 0, 0.5, 10**5000, 0]])


def test_the_package_lists_what_it_offers():
    assert set(dir(fractal_exp)) == {*fractal_exp.__all__, "__version__"}
    assert all(getattr(fractal_exp, name) is not None for name in dir(fractal_exp))
