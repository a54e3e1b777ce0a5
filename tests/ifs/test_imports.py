"""Codes as people have them: tables, columns in any order, old encodings, flames of several programs; and the report of
what was read, what was left out and why."""

from functools import reduce

import numpy as np
import pytest
import torch
from commands import refusal, said
from flam3 import DRAWS, difference, drawn
from format_files import flame, xform

from fractal_exp import IFS, InputError, View, codes, render
from fractal_exp.cli import convert
from fractal_exp.cli import render as render_app
from fractal_exp.evaluation.metrics import f1
from fractal_exp.ifs import formats

GASKET = "0.5 0 0 0.5 0 0 0.34\n0.5 0 0 0.5 0.5 0 0.33\n0.5 0 0 0.5 0.25 0.433 0.33\n"
KOCH = IFS([[[0.3, -0.2], [0.1, 0.4]], [[0.2, 0.5], [-0.3, 0.1]]], [[1, 2], [3, 4]], [0.25, 0.75])
PLACES = "columns are read as"


def read(folder, text, suffix=".csv", **how):
    path = folder / f"code{suffix}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return formats.read(path, **how)


def code_of(rows, weights=None):
    """The code of rows a b c d e f, whether or not it is one that can be drawn."""
    table = torch.tensor(rows, dtype=torch.float64)
    return IFS(table[:, :4].reshape(-1, 2, 2), table[:, 4:], weights)


def same(a, b):
    return torch.equal(a.linear, b.linear) and torch.equal(a.offset, b.offset) and (
        a.probabilities is b.probabilities is None or torch.equal(a.probabilities, b.probabilities))


@pytest.mark.parametrize(("text", "suffix"), [
    (GASKET, ".csv"), (GASKET, ".ifs"), (GASKET.replace(" ", ","), ".csv"), (GASKET.replace(" ", ", "), ".txt"),
    (GASKET.replace(" ", "\t"), ".tsv"), (GASKET.replace(" ", ";"), ".csv"),
    (GASKET.replace(" ", "; "), ".csv"),
    (f"3\n{GASKET}", ".ifs"), (f"# gasket, a b c d e f p\n\n{GASKET}", ".txt"),
    (f"a,b,c,d,e,f,prob\n{GASKET}", ".csv"), (f"\ufeff{GASKET}".replace("\n", "\r\n"), ".dat"),
    (f"gasket {{\n{GASKET}}}", ".txt"), (f"[[{GASKET.strip()}]]".replace(" ", ", ").replace("\n", "], ["), ".txt"),
    ("5.0e-01,0.0E+00,-0,+.5,0,0,.34 ; stem\n0.5 , 0 ,0,0.5, 0.5,0 ,0.33 # leaf\n0.5,0,0,0.5,0.25,0.433,0.33,\n",
     ".csv"),
])
def test_a_table_is_a_code(tmp_path, text, suffix):
    found = read(tmp_path, text, suffix)
    assert same(found.code, code_of([[0.5, 0, 0, 0.5, 0, 0], [0.5, 0, 0, 0.5, 0.5, 0], [0.5, 0, 0, 0.5, 0.25, 0.433]],
                                    [0.34, 0.33, 0.33]))
    assert any(line.startswith(PLACES) for line in found.report) == ("{" not in text and "[" not in text)


def test_rows_of_six_have_no_probabilities_and_a_comment_stays(tmp_path):
    found = read(tmp_path, "; by hand\n.5 0 0 .5 0 0\n.5 0 0 .5 .5 0 # right\n")
    assert found.code.probabilities is None and found.code.meta == {"comment": "by hand\nright"}
    assert found.report == ("2 maps read", "columns are read as a b c d e f of x' = a x + b y + e, y' = c x + d y + f; "
                                           "if they stand otherwise, say so, as in --order abecdf")


@pytest.mark.parametrize(("text", "order"), [
    (".3 -.2 1 .1 .4 2 .25\n.2 .5 3 -.3 .1 4 .75", "abecdf"), (".3 -.2 1 .1 .4 2 .25\n.2 .5 3 -.3 .1 4 .75", "ABECDFP"),
    (".25 .3 -.2 .1 .4 1 2\n.75 .2 .5 -.3 .1 3 4", "pabcdef"), (".3 .1 -.2 .4 1 2 .25\n.2 -.3 .5 .1 3 4 .75", "acbdef"),
    ("p a b e c d f\n.25 .3 -.2 1 .1 .4 2\n.75 .2 .5 3 -.3 .1 4", None),
    ("a b c d e f p\n.3 -.2 1 .1 .4 2 .25\n.2 .5 3 -.3 .1 4 .75", "abecdf"),  # what is said goes before the heading
    ("koch { .3 -.2 1 .1 .4 2 .25 .2 .5 3 -.3 .1 4 .75 }", "abecdf"),
    ("2\n.25 .75\n2 3\n.3 -.2 1\n.2 .5 3\n2 3\n.1 .4 2\n-.3 .1 4\n", None),
    ("[[0.3, -0.2, 1, 0.1, 0.4, 2, 0.25], [0.2, 0.5, 3, -0.3, 0.1, 4, 0.75]]", "abecdf"),
])
def test_columns_may_stand_in_any_order(tmp_path, text, order):
    found = read(tmp_path, text, order=order)
    assert same(found.code, KOCH) and same(IFS.load(tmp_path / "code.csv", order=order), KOCH)
    letters = " ".join((order or ("pabecdf" if text[0] == "p" else "abecdf")).lower())
    assert "[" in text or any(line.startswith(f"{PLACES} {letters}") for line in found.report)


@pytest.mark.parametrize(("text", "suffix", "order", "message"), [
    (GASKET, ".csv", "abcde", "names a, b, c, d, e and f once each"), (GASKET, ".csv", "aabcdef", "got 'aabcdef'"),
    (".5 0 0 .5 0 0", ".csv", "pabcdef", "the order pabcdef has seven columns, and the rows have six numbers"),
    (flame(xform()), ".flame", "abecdf", "flame files have no rows of numbers; leave order"),
    ('{"ifs_m": [[0, 0, 0, 0]], "ifs_t": [[0, 0]]}', ".json", "abecdf", "the file has no rows of numbers; leave order"),
])
def test_an_order_that_says_nothing_is_refused(tmp_path, text, suffix, order, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, text, suffix, order=order)


@pytest.mark.parametrize(("data", "name"), [
    ("feuille { ; déjà vu\n.5 0 0 .5 0 0 }".encode("latin-1"), "feuille"),
    ("\ufefffeuille { ; déjà vu\r\n.5 0 0 .5 0 0 }".encode("utf-16-le"), "feuille"),
    ("feuille { ; déjà vu\n.5 0 0 .5 0 0 }".encode("utf-16") + b"\x1a\0", "feuille"),
])
def test_old_encodings_are_read(tmp_path, data, name):
    found = read(tmp_path, data, ".ifs")
    assert found.code.meta == {"name": name, "comment": "déjà vu"}
    assert ("Windows-1252" in str(found.report)) == (data[0] == ord("f"))


def test_an_encoding_that_xml_declares_is_believed_where_the_text_is_not_utf_8(tmp_path):
    text = f'<?xml version="1.0" encoding="ISO-8859-5"?>{flame(xform(), name="лес")}'
    found = read(tmp_path, text.encode("iso-8859-5"), ".flame")
    assert found.code.meta["name"] == "лес" and "Windows" not in str(found.report)
    for unknown in "8859-99", "8859-12":
        assert read(tmp_path, text.replace("8859-5", unknown).encode("iso-8859-5"), ".flame").code.meta["name"] != "лес"


def test_weights_below_0_are_what_they_are_to_fractint(tmp_path):
    found = read(tmp_path, "neg { .3 0 0 .3 0 0 -.14 .5 0 0 .5 1 0 .49 .5 0 0 .5 0 1 .49 .5 0 0 .5 1 1 .16 }", ".ifs")
    torch.testing.assert_close(found.code.probabilities, torch.tensor([0, 0.35, 0.49, 0.16]))
    assert found.report[1:] == ("weights below 0 are added up with those after them, as Fractint does",
                                "never chosen, as its weight is not above 0: map 1")


@pytest.mark.parametrize(("text", "suffix", "code"), [
    ("zero { 1 0 0 1 0 0 0\n.5 0 0 .5 0 0 .5\n.5 0 0 .5 .5 0 .5 }", ".ifs",
     code_of([[1, 0, 0, 1, 0, 0], [0.5, 0, 0, 0.5, 0, 0], [0.5, 0, 0, 0.5, 0.5, 0]], [0, 0.5, 0.5])),
    (flame(xform(weight=0, coefs="1 0 0 1 0 0"), xform(coefs=".5 0 0 .5 0 0")), ".flame",
     code_of([[1, 0, 0, 1, 0, 0], [0.5, 0, 0, 0.5, 0, 0]], [0, 1])),
    ("2.0e-01,-1.0e+00,3.0e-01,1.0e-01,4.0e-01,-2.0e-01,5.5e-01\n.4,.3,-.2,.5,-.3,.1,.45\n", ".csv",
     code_of([[0.2, -1, 0.3, 0.1, 0.4, -0.2], [0.4, 0.3, -0.2, 0.5, -0.3, 0.1]], [0.55, 0.45])),
    ("takagi { .5 0 1 .5 0 0 .5\n.5 0 -1 .5 .5 .5 .5 }", ".ifs",
     code_of([[0.5, 0, 1, 0.5, 0, 0], [0.5, 0, -1, 0.5, 0.5, 0.5]], [0.5, 0.5])),
    ("turn { .5 -.3 .3 .5 1 1 .5\n-1 0 0 -1 0 10 .5 }", ".ifs",
     code_of([[0.5, -0.3, 0.3, 0.5, 1, 1], [-1, 0, 0, -1, 0, 10]], [0.5, 0.5])),
    (flame(xform(coefs=".9 0 0 .2 0 0"), xform(coefs=".1 .3 -.3 .1 .5 .5"),
           '<finalxform linear="1" coefs="0.2 0 0 3 0 0"/>'), ".flame",
     code_of([[0.9, 0, 0, 0.2, 0, 0], [0.1, 0.02, -4.5, 0.1, 0.1, -1.5]], [0.5, 0.5])),
], ids=["zero", "zero-flame", "stretch", "takagi", "turn", "final"])
def test_codes_whose_maps_do_not_all_contract_are_read_if_any_are(tmp_path, text, suffix, code):
    found = read(tmp_path, text, suffix)
    torch.testing.assert_close(found.code.linear, code.linear)
    torch.testing.assert_close(found.code.offset, code.offset)
    assert same(IFS(code.linear, code.offset, found.code.probabilities), code)
    assert float(code.probabilities.min()) > 0 or "never chosen, as its weight is not above 0: map 1" in found.report


PALETTE = " ".join(bytes((k, 255 - k, 128)).hex() for k in range(256))


def test_the_affine_maps_of_other_programs_are_read_and_what_is_left_out_is_told(tmp_path):
    text = flame(
        xform(linear=0.4, linear3D=0.6, color_type="DIFFUSION", material="0.5", linear_fx_priority=0, chaos="1.0 1.0",
              onclick="alert(1)", opacity=0.5, flatten=1, swirl=0, target="1 2"),
        xform(linear=0, linear3D=0.5, coefs="1 6.1E-17 0 1 0 0", animate=1),
        "<edit><sheep/></edit>", version="JWildfire", rotate="90", cam_pitch=0.9, cam_zoom="1.0", cam_yaw="0.0",
        quality=9)
    found = read(tmp_path, text, ".flame")
    torch.testing.assert_close(found.code.linear, 0.5 * torch.eye(2).expand(2, 2, 2))
    assert found.report == (
        "2 maps read, with probabilities", "weights are divided by their sum, 2",
        "left out: the camera's turn and tilt, so that the plane is seen straight from above (cam_pitch, rotate)",
        "left out: attributes of maps that do not move points (color_type, flatten, material, onclick, opacity, "
        "target)",
        "left out: elements (edit)", "left out: how the flame is drawn (quality, version)")


@pytest.mark.parametrize(("palette", "report"), [
    ('<color index="0" rgb="255 0 0"/><color index="255" rgb="0 0 255"/>', ()),
    (f'<palette count="256" format="RGB">\n{PALETTE}\n</palette>', ("colours are mixed in red, green and blue",)),
    (f'<palette count="256" format="RGBA">{"".join(f"{rgb}ff" for rgb in PALETTE.split())}</palette>', ("",)),
    (f'<colors count="256" data="{"".join(f"00{rgb}" for rgb in PALETTE.split())}"/>', ("",)),
])
def test_a_palette_gives_colours(tmp_path, palette, report):
    maps = xform(color="0 0"), xform(color_speed=0.25), xform(color=0.5, symmetry=-1)
    found = read(tmp_path, flame(*maps, palette), ".flame")
    rgb = [[0, 255, 128], [255, 0, 128], [128, 127, 128]] if report else [[255, 0, 0], [0, 0, 255], [127, 0, 128]]
    torch.testing.assert_close(found.code.colours.rgb, torch.tensor(rgb) / 255, atol=0.005, rtol=0)
    assert found.code.colours.blends.tolist() == [0.5, 0.25, 1]
    assert found.report[0] == "3 maps read, with probabilities and colours" and len(found.report) == 2 + len(report)


@pytest.mark.parametrize(("elements", "reason"), [
    ('<color index="0" rgb="1 2 3"/>', "the file has no palette of two colours"),
    ('<color index="256" rgb="1 2 3"/>' * 2, "elements (color)"), ("<color/>", "elements (color)"),
    ('<palette count="2" format="RGB">00112</palette>', "elements (palette)"),
    (f'<palette format="RGB">{"0" * 20_000}</palette>', "elements (palette)"),
    ('<colors data="0011223344556677"/><finalxform linear="1" coefs="1 0 0 1 0 0" color="x"/>',
     "colours, as a color must be a number"),
])
def test_colours_that_the_file_does_not_settle_are_left_out(tmp_path, elements, reason):
    found = read(tmp_path, flame(xform(color=0), elements), ".flame")
    assert found.code.colours is None and "left out: colours, as" in str(found.report) and reason in str(found.report)


def test_maps_without_a_colour_have_none(tmp_path):
    found = read(tmp_path, flame(xform(color_speed=0), '<colors data="0011223344556677"/>'), ".flame")
    assert found.code.colours is None and "left out: colours, as no map that is chosen has one" in found.report


def test_a_code_without_colours_gets_none_from_the_palette_that_tells_its_maps_apart(tmp_path):
    path = codes.known("fern").save(tmp_path / "fern.flame")
    assert IFS.load(path).colours is None


@DRAWS
@pytest.mark.parametrize("final", ["", '<finalxform linear="1" coefs="1 0 0 1 0 0" color="0.5" color_speed="0.6"/>'])
def test_colours_that_are_read_are_those_that_flam3_draws(tmp_path, final):
    look = {"size": "1024 1024", "center": ".25 .25", "scale": 1700, "brightness": "0.3", "gamma": 8, "vibrancy": 1,
            "gamma_threshold": "0.001", "filter": "0.1", "quality": 48, "palette_mode": "linear", "estimator_radius": 0}
    path = tmp_path / "code.flame"
    path.write_text(flame(*(xform(coefs=f".5 0 0 .5 {x} {y}", color=c, color_speed=1) for x, y, c in (
        (0, 0, 0), (0.25, 0, 0.3), (0, 0.25, 1))), final, *(f'<color index="{index}" rgb="{rgb}"/>' for index, rgb in (
            (0, "255 0 0"), (99, "20 200 40"), (255, "0 0 255"))), **look))
    code = IFS.load(path)
    drawn_by_us = render(code, View(**code.meta["camera"]), resolution=128, mode="colour")
    assert difference(path, code, drawn_by_us) < 2


KINDS = (2, 3, 5, 1, -1, -2, -3)


def moments(maps, weights, most=4):
    """The moments of the chaos game's measure up to an order: the fixed vector of all maps together on tensors."""
    homogeneous = [np.block([[m, np.array(t)[:, None]], [np.zeros((1, 2)), np.ones((1, 1))]]) for m, t in maps]
    step = sum(w / sum(weights) * reduce(np.kron, [each] * most) for each, w in zip(homogeneous, weights, strict=True))
    values, vectors = np.linalg.eig(step)
    k = int(np.abs(values - 1).argmin())
    return (vectors[:, k] / vectors[-1, k]).real


@pytest.mark.parametrize("kind", KINDS)
def test_a_symmetry_is_written_out_with_the_same_measure(tmp_path, kind):
    coefs, weights = [[0.4, 0.1, -0.1, 0.4, 0.6, 0.1], [0.3, -0.2, 0.5, 0.2, -0.4, 0.3]], [1, 0.7]
    text = flame(*(xform(coefs=" ".join(map(str, c)), weight=w) for c, w in zip(coefs, weights, strict=True)),
                 f'<symmetry kind="{kind}"/>')
    code = read(tmp_path, text, ".flame").code
    assert len(code) == 2 * abs(kind) * (2 if kind < 0 else 1)
    angles = 2 * np.pi * np.arange(1, abs(kind)) / abs(kind)
    added = [np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]) for t in angles]
    added += [np.diag([-1, 1])] * (kind < 0)
    down = np.diag([1.0, -1.0])  # flam3's y, in which the maps stand
    maps = [(np.array([[a, c], [b, d]]), (e, f)) for a, b, c, d, e, f in coefs] + [(m, (0, 0)) for m in added]
    maps = [(down @ m @ down, down @ t) for m, t in maps]
    ours = [(m.double().numpy(), t.double().numpy()) for m, t in code]
    np.testing.assert_allclose(moments(ours, code.probabilities.tolist()), moments(maps, weights + [1] * len(added)),
                               atol=1e-5)


@DRAWS
@pytest.mark.parametrize("kind", [3, -2])
def test_a_symmetry_is_what_flam3_draws(tmp_path, kind):
    path = tmp_path / "code.flame"
    path.write_text(flame(xform(coefs=".5 .2 -.2 .5 .6 .1"), f'<symmetry kind="{kind}"/>',
                          '<color index="0" rgb="255 255 255"/>', size="1024 1024", scale="300",
                          filter="0.1", gamma_threshold="0.01", quality="48", brightness="4", estimator_radius="0"))
    code = IFS.load(path)
    image = drawn(path)
    assert float(f1(image[None], render(code, View(**code.meta["camera"]), resolution=256)[None])) >= 0.95
    alone = code_of([[0.5, 0.2, -0.2, 0.5, 0.6, -0.1]])
    assert float(f1(image[None], render(alone, View(**code.meta["camera"]), resolution=256)[None])) < 0.5


def test_text_between_entries_is_a_comment_or_is_told(tmp_path):
    entry = "fern #2 {\n.5 0 0 .5 0 0 # stem\n}\n"
    found = read(tmp_path, f"; of the course\n# 1994\nnotes on it\n\n{entry}", ".ifs")
    assert found.code.meta == {"name": "fern #2", "comment": "of the course\n1994\nstem"}
    assert found.report == ("1 map read", "left out: what stands between entries, from 'notes' on")
    assert read(tmp_path, f"{entry}the end", ".ifs").report[1] == "left out: what stands between entries, from 'the' on"


COLLECTION = ("sheep { .5 0 0 .5 0 0 1 }\n fish { .5 0 0 .5 1 0 3 .5 0 0 .5 0 1 1 }\n bird { .5 0 0 x 0 0 1 }\n"
              "goat { .5 0 0 .5 1 1 2 }\n")


def test_a_collection_is_converted_whole_and_told_of(folder, capsys):
    (folder / "all.ifs").write_text(COLLECTION)
    convert.main(["all.ifs", "all.flame"])
    out, told = capsys.readouterr()
    assert out == f"{folder}/all.flame (flame, 1 maps, 2 maps, 1 maps)\n"
    assert told.splitlines() == [
        "all.ifs:sheep: 1 map read, with probabilities", "all.ifs:fish: 2 maps read, with probabilities",
        "all.ifs:fish: weights are divided by their sum, 4",
        "all.ifs:bird: not read: entry 'bird': number 4 of map 1 must be a number, got 'x'",
        "all.ifs:goat: 1 map read, with probabilities", "all.ifs:goat: weights are divided by their sum, 2"]
    assert [entry.name for entry in formats.listing("all.flame")] == ["sheep", "fish", "goat"]
    (folder / "none.ifs").write_text("a { x }\nb { y }")
    assert "the file holds 4 codes; choose one" in refusal(convert, "all.ifs", "one.json")
    assert "none of the 2 codes can be read, as told above" in said(convert, "none.ifs", "none.flame")


def test_a_name_in_other_letter_case_is_the_name(folder):
    (folder / "all.ifs").write_text(f"{COLLECTION} GOAT {{ .5 0 0 .5 2 2 1 }} ")
    assert IFS.load("all.ifs", "Fish").meta["name"] == "fish"
    assert IFS.load("all.ifs", "GOAT").offset.tolist() == [[2, 2]]  # the very name goes first
    with pytest.raises(InputError, match="2 codes are called 'Goat'; choose by number: #4, #5"):
        IFS.load("all.ifs", "Goat")
    convert.main(["Fern", "all.ifs:SHEEP", "two.ifs"])
    assert [entry.name for entry in formats.listing("two.ifs")] == ["fern", "sheep"]


def test_columns_are_named_on_the_command_line(folder, capsys):
    (folder / "koch.csv").write_text(".3,-.2,1,.1,.4,2,.25\n.2,.5,3,-.3,.1,4,.75\n")
    convert.main(["koch.csv", "koch.json", "--order", "abecdf"])
    assert same(IFS.load("koch.json"), KOCH)
    told = capsys.readouterr().err
    assert told == ("koch.csv: 2 maps read, with probabilities\n"
                    "koch.csv: columns are read as a b e c d f p of x' = a x + b y + e, y' = c x + d y + f\n")
    for other in ("fern", "suite:1"):
        told = refusal(convert, other, "other.json", "--order", "abecdf")
        assert "no file with rows of numbers; leave --order out" in told
    for name in ("koch.csv --order abecdf", "koch.json"):
        render_app.main([*name.split(), f"{len(name)}.png", "--size", "48"])
    assert (folder / "23.png").read_bytes() == (folder / "9.png").read_bytes()
