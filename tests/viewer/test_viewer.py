"""The page as a file: one of its own, under a policy that lets it load nothing, of codes that it can show."""

import base64
import hashlib
import html
import json
import re
import shutil
import subprocess

import pytest
import torch
from commands import refusal
from places import ROOT

from fractal_exp import IFS, Colours, InputError, View, codes
from fractal_exp.cli import view as fractal_view
from fractal_exp.ifs import attractor
from fractal_exp.viewer.linking import linked
from fractal_exp.viewer.page import page

LARGEST = 200_000
HOSTILE = "</script><script>alert(1)</script><!-- \u2028 & ' \" $title"


def given(text: str) -> dict:
    """What the page reads of its code."""
    return json.loads(re.search(r'<script type="application/json" id="given">(.*?)</script>', text)[1])


def held(text: str) -> IFS:
    """The code that the page holds."""
    code = given(text)["code"]
    colours = code["colours"] or {"rgb": None, "blends": None}
    rows, chances, rgb, blends = (
        None if part is None else torch.frombuffer(bytearray(base64.b64decode(part)), dtype=torch.float32)
        for part in (code["rows"], code["probabilities"], colours["rgb"], colours["blends"]))
    rows = rows.reshape(-1, 6)
    return IFS(rows[:, :4].reshape(-1, 2, 2), rows[:, 4:], chances, code["meta"],
               None if rgb is None else Colours(rgb.reshape(-1, 3), blends))


def sha(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


@pytest.mark.skipif(not shutil.which("node"), reason="node is not installed: the page's modules are not tested alone")
def test_the_modules_pass_their_own_tests():
    files = sorted((ROOT / "tests" / "browser").glob("*.test.mjs"))
    done = subprocess.run(["node", "--test", *files], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(re.search(r"^# pass (\d+)$", done.stdout, re.MULTILINE)[1]) >= len(files)


def test_a_page_is_small_and_its_policy_allows_its_own_script_and_style_alone():
    text = page(codes.known("fern"))
    policy = html.unescape(re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1])
    script = re.search(r'<script type="module">(.*?)</script>', text, re.DOTALL)[1]
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL)[1]
    assert policy == (f"default-src 'none'; script-src {sha(script)}; style-src {sha(style)}; img-src data: blob:; "
                      "base-uri 'none'; form-action 'none'")
    assert len(text.encode()) <= LARGEST
    assert not re.search(r"https?://|@import|\burl\(|\beval\(|innerHTML|<link", text)


def test_the_page_holds_the_code_to_the_last_digit_and_the_view_that_it_opens_on():
    code = attractor.normalize(codes.known("maple_leaf"))
    text = page(code, view=View((0.1, -0.3), 64))
    data, inside = given(text), held(text)
    assert torch.equal(inside.linear, code.linear) and torch.equal(inside.offset, code.offset)
    assert torch.equal(inside.probabilities, code.probabilities)
    assert inside.meta == {"name": "maple_leaf", "title": "Maple leaf"}
    assert held(page(codes.known("koch_curve"))).probabilities is None
    assert data["home"] == {"x": 0, "y": 0, "zoom": 1} and data["view"] == {"x": 0.1, "y": -0.3, "zoom": 64}
    assert data["file"] == "maple-leaf"


def test_a_name_stays_text():
    fern = codes.known("fern")
    text = page(IFS(fern.linear, fern.offset, fern.probabilities, {"title": HOSTILE, "other": HOSTILE, "name": 3}))
    assert "<script>alert" not in text and text.count("</script>") == 2
    assert given(text)["title"] == " ".join(HOSTILE.split())
    assert given(text)["code"]["meta"] == {"title": " ".join(HOSTILE.split())}
    long = given(page(IFS([[[0.5, 0], [0, 0.5]]], [[1.0, 2.0]], meta={"name": "\ud800" + "x" * 5000})))
    assert len(long["title"]) == 120 and long["title"].startswith("?x") and re.fullmatch("x{1,40}", long["file"])


WILD = IFS([[[1.01, 0], [0, 0.5]]], [[0.0, 0.0]])
MANY = IFS(torch.zeros(1_000_000, 2, 2), torch.zeros(1_000_000, 2))


@pytest.mark.parametrize(("code", "name", "message"), [
    (WILD, "wild.html", "map 1 has singular value 1.01"),
    (MANY, "many.html", "at most 1000 maps, got 1000000"),
    (codes.known("fern"), "fern.png", "a page is written as HTML, got 'fern.png'; end the name in .html"),
    (codes.known("fern"), "nowhere/fern.html", "choose a folder that exists"),
])
def test_what_makes_no_page_is_refused_and_nothing_is_written(code, name, message, tmp_path):
    with pytest.raises(InputError, match=re.escape(message)):
        code.save_html(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("size", "message"), [
    ("5000", "--size must be from 1 to 4096 pixels a side, such as 1024, or 1920x1080 (width x height), got '5000'"),
    ("wide", "got 'wide'"), ("0x9", "got '0x9'")])
def test_a_size_that_no_page_has_is_refused(size, message, folder):
    assert message in refusal(fractal_view, "fern", "--size", size) and not list(folder.iterdir())
    with pytest.raises(InputError, match=r"at most 4096 pixels a side, got resolution=\(10, 5000\)"):
        codes.known("fern").save_html(folder / "fern.html", resolution=(10, 5000))


def test_a_page_knows_the_size_of_its_picture(folder):
    fractal_view.main(["fern", "--size", "1920x1080"])
    assert '"size":[1920,1080]' in (folder / "fern.html").read_text()
    assert '"size":null' in page(codes.known("fern"))


def test_as_many_maps_as_are_allowed_fit_into_a_page_with_their_colours():
    generator = torch.Generator().manual_seed(0)
    colours = Colours(torch.rand(1000, 3, generator=generator), torch.rand(1000, generator=generator))
    code = IFS(torch.rand(1000, 2, 2, generator=generator) / 5, torch.rand(1000, 2, generator=generator),
               torch.full((1000,), 0.001), {"title": "<" * 500, "name": "<" * 500}, colours)
    full = page(code, still=bytes(20_000))
    assert len(full.encode()) <= LARGEST and "data:image/png" not in full  # the still has to go
    assert "data:image/png" in page(codes.known("fern"), still=bytes(20_000))
    assert torch.equal(held(full).linear, code.linear) and torch.equal(held(full).colours.rgb, colours.rgb)


def test_a_notebook_shows_a_frame_or_nothing():
    assert codes.known("fern")._repr_html_().startswith("<iframe srcdoc=")
    assert WILD._repr_html_() is None and MANY._repr_html_() is None


def test_the_command_writes_the_page_of_a_code_on_the_canvas(folder, capsys):
    fractal_view.main(["suite:2", "--center", "0.1", "-0.2", "--zoom", "8"])
    assert given((folder / "suite-2.html").read_text())["view"] == {"x": 0.1, "y": -0.2, "zoom": 8}
    codes.known("fern").save("leaf.json")
    fractal_view.main(["leaf.json"])
    assert given((folder / "leaf.html").read_text())["home"] == {"x": 0, "y": 0, "zoom": 1}
    fractal_view.main(["leaf.json", "--frame", "own", "-o", "own.html"])
    assert given((folder / "own.html").read_text())["home"]["zoom"] == pytest.approx(0.15, rel=0.01)
    assert "own.html (" in capsys.readouterr().out


@pytest.mark.parametrize(("words", "message"), [
    (["ferm"], "did you mean 'fern'?"), (["fern", "--zoom", "3"], "needs both --center X Y and --zoom"),
    (["fern", "--zoom", "-3", "--center", "0", "0"], "must be a finite number above 0"),
])
def test_a_wrong_command_is_one_line(words, message, folder):
    assert message in refusal(fractal_view, *words) and not list(folder.iterdir())


def test_modules_are_linked_in_the_order_of_their_imports():
    modules = {"main": 'import {\n  f,\n} from "./a.mjs";\nimport { X } from "./b.mjs";\nf(X);\n',
               "a": '// own 1\nimport { X } from "./b.mjs";\n/** own 1\n * own 1. */\nconst own = "a//kept";\n'
                    "export async function f() {}\n",
               "b": "const own = 2;\nexport const X = own;\n"}
    text = linked(modules, "main")
    assert [text.index(f"const {name}Module") for name in "ba"] == sorted(text.index(f"const {n}Module") for n in "ba")
    assert "const { f } = aModule;" in text and "return { f };" in text and "export" not in text
    assert "own 1" not in text and "//kept" in text  # comments of whole lines are left out, and nothing else
