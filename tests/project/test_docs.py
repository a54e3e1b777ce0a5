"""The documentation: links lead somewhere, the site builds and loads nothing from elsewhere, and its code runs."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Literal

import pytest
from places import ROOT
from pydantic import BaseModel, ConfigDict, Field
from pydantic.dataclasses import dataclass

from docs import hooks
from docs import tables as results

DOCS = ROOT / "docs"
EXTENDING = sorted((DOCS / "extending").glob("*.md"))
LARGEST_PICTURES = 3_500_000
LINK = re.compile(r'\]\((?!https?:|#)([^)#\s]+)|<img src="([^"]+)"')
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)


Amount = Annotated[float, Field(ge=0)]


class Descent(BaseModel):
    """A descent."""

    steps: int = Field(ge=1, description="Steps.")
    rate: float = Field(0.5, description="Rate.")


@dataclass(frozen=True)
class Births:
    """How maps are born.

    More about it."""

    candidates: Annotated[int, Field(ge=1, description="Candidates of a birth.")] = 48
    blobs: Annotated[float, Field(gt=0, le=1)] = 1 / 3
    """Share of candidates with
    the |det| of a blob."""


class Params(BaseModel):
    """All of them."""

    model_config = ConfigDict(frozen=True)

    births: Births = Births(candidates=7)
    first: Descent = Field(Descent(steps=150), description="The start.")
    then: Descent = Field(Descent(steps=25, rate=0.25), description="The rest.")
    step: float = Field(0.05, ge=0, le=1, description="Of a difference.", json_schema_extra={"unit": "px"})
    maps: Annotated[int, Field(ge=2)] | None = Field(None, description="How many.")
    sizes: tuple[Amount, Amount] = Field((0.1, 1.0), description="From to.")
    levels: Literal["auto", "binary"] = Field("auto", description="What greys mean.")
    on: bool = Field(True, description="Whether at all.")


@pytest.mark.parametrize("page", [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))], ids=lambda page: page.name)
def test_every_link_of_a_page_leads_to_a_file(page):
    found = {path or image for path, image in LINK.findall(page.read_text())}
    assert [path for path in sorted(found) if not (page.parent / path).exists()] == []


def test_the_readme_is_short_and_its_pictures_are_small():
    assert len((ROOT / "README.md").read_text().split()) <= 900
    pictures = [path for path in (DOCS / "images").rglob("*") if path.is_file()]
    assert pictures and sum(path.stat().st_size for path in pictures) < LARGEST_PICTURES


def tables(owner, prefix=""):
    """The tables of a class, with ~ for the spaces that do not break."""
    return hooks.parameter_tables(owner, prefix).replace(hooks.SPACE, "~")


def test_a_parameter_class_becomes_tables_with_ranges_units_and_meanings():
    assert tables(Params, "method") == """\
| name | default | range | unit | meaning |
| --- | --- | --- | --- | --- |
| `method.step` | `0.05` | 0 … 1 | px | Of a difference. |
| `method.maps` | `null` | ≥~2, null |  | How many. |
| `method.sizes` | `[0.1, 1.0]` | each ≥~0 |  | From to. |
| `method.levels` | `auto` | `auto`, `binary` |  | What greys mean. |
| `method.on` | `true` | true, false |  | Whether at all. |

**`method.births`**: How maps are born.

| name | default | range | meaning |
| --- | --- | --- | --- |
| `method.births.candidates` | `7` | ≥~1 | Candidates of a birth. |
| `method.births.blobs` | `0.333333` | >~0, ≤~1 | Share of candidates with the \\|det\\| of a blob. |

**A descent.** Each of these has

- `steps`: Steps. (≥~1)
- `rate`: Rate.

| name | `.steps` | `.rate` | of |
| --- | --- | --- | --- |
| `method.first` | `150` | `0.5` | The start. |
| `method.then` | `25` | `0.25` | The rest. |"""


def test_a_line_of_a_page_asks_for_the_tables_and_a_comment_does_not():
    page = f"before\n\n[parameters: {__name__}.Params method]\n\n<!-- [parameters: nowhere.Nothing] -->\n"
    assert hooks.on_page_markdown(page) == (
        f"before\n\n{hooks.parameter_tables(Params, 'method')}\n\n<!-- [parameters: nowhere.Nothing] -->\n")


ASKED = [(page, line) for page in sorted(DOCS.glob("*.md")) for line in hooks.TABLE.findall(page.read_text())]


@pytest.mark.parametrize(("page", "asked"), ASKED, ids=lambda each: each[0] if isinstance(each, tuple) else each.stem)
def test_every_table_of_results_is_made_from_files_that_are_there(page, asked):
    maker, names = asked
    head, rule, *rows = results.table(maker, *names.split()).splitlines()
    assert rows and {line.count(" | ") for line in (head, rule, *rows)} == {head.count(" | ")}


def test_a_table_of_results_states_what_its_files_hold(tmp_path):
    def table(maker, *names):
        return results.table(maker, *(str(tmp_path / name) for name in names)).splitlines()

    for folder, f1, recovered, count in (("older", "f1_box", "exact", 5), ("parts", "f1", "recovered", 3)):
        fits = [{"set": folder, "without": part, "target": k, f1: 0.9 - 0.1 * (part != "nothing"),
                 recovered: part == "nothing" or k < 2} for part in ("nothing", "roots") for k in range(count)]
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "codes.jsonl").write_text("\n".join(map(json.dumps, fits)))
    assert hooks.on_page_markdown(f"[table: ablation {tmp_path}/older {tmp_path}/parts]").splitlines()[2:] == [
        "| nothing | .900<br>5 of 5 | .900<br>3 of 3 |",
        "| `roots` | **−.100** [−.100, −.100]<br>−3 | −.100<br>−1 |"], "three differences have no interval"
    rows = {"full": (.6, .7), "no_mip": (.4, .5)}
    (tmp_path / "paper").mkdir()
    (tmp_path / "paper" / "fits.jsonl").write_text("\n".join(json.dumps(
        {"row": row, "sample": f"fractal {k}", "seconds": 30, "scores": {"f1": f1, "iou": .5, "psnr": 9, "ssim": .4}})
        for row, scores in rows.items() for k, f1 in enumerate(scores)))
    assert table("paper_ablations", "paper")[2:] == [
        "| `full` | .650 | .500 | 9.0 | .400 |  | .611 |  | 30 |",
        "| `no_mip` | .450 | .500 | 9.0 | .400 | **−.200** [−.200, −.200] | .363 | −.248 | 30 |"]
    course = [[1, .3, 5], [2, .4, 10], [3, .6, 15], [4, .7, 20], [5, .8, 20]]
    fit = {"row": "3 maps", "sample": "seed 0", "seconds": 40, "scores": {"f1": .6, "iou": .5, "psnr": 9, "ssim": .4},
           "course": course, "code": {"linear": [[[.5, 0], [0, .5]], [[.05, 0], [0, .1]]]}}
    (tmp_path / "paper" / "fits.jsonl").write_text(json.dumps(fit) + "\n" + json.dumps(fit | {"sample": "seed 1"}))
    assert table("function_count", "paper")[2:] == ["| 3 maps | .600 | .600, .600 | 1, 1 | 40 |"]
    assert table("real", "paper")[2] == (
        "| seed 0 | `3 maps` | 2 | .600 | .500 | 9.0 | .400 | 40 |")
    assert table("convergence", "paper")[0::2] == [
        "| row | 5 iterations | 10 iterations | 15 iterations | 20 iterations | all views | seconds |",
        "| `3 maps` | .300 | .400 | .600 | .800 | .600 | 40 |"]
    (tmp_path / "times.jsonl").write_text(json.dumps({"figures": {"steps": [
        {"step": "a step", "seconds": 0.0123, "twin_seconds": 2.5, "twin_ratio": 203.2}]}}))
    assert table("speed", "times.jsonl")[-1] == "| a step | 12.3 ms | 2.5 s | 203 |"


def test_a_table_of_results_without_a_maker_or_a_file_is_refused():
    with pytest.raises(ValueError, match="there is no table speeds; choose from suite, codes"):
        results.table("speeds", "cpu_ops.jsonl")
    with pytest.raises(ValueError, match="benchmarks/results has no cpu.jsonl, which the table speed names"):
        results.table("speed", "cpu.jsonl")


def test_every_file_of_results_that_a_page_names_is_there():
    for page in (ROOT / "README.md", DOCS / "results.md"):
        named = re.findall(r"benchmarks/results/[\w./-]*\w", page.read_text())
        assert named and [name for name in named if not (ROOT / name).exists()] == [], page.name


def test_the_readme_expects_five_numbers_which_are_those_of_the_files():
    [section] = re.findall(r"## What to expect\n(.*?)\n## ", (ROOT / "README.md").read_text(), re.DOTALL)
    stated = [line.split(" | ")[0].strip("| ") for line in section.splitlines() if line.startswith("| ")][1:]
    views = {tuple(line.split(" | ")[:3]): line.split(" | ")[3] for line in
             results.table("suite", "collage_2025_grey").splitlines()}
    exact, _, _, seconds, *_ = results.table("codes", "collage_2025_grey").splitlines()[2].strip("| ").split(" | ")
    [recovered] = re.findall(r"recovered \| (\d+) of (\d+)", results.table("textbook", "pictures_textbook_120s"))
    shapes = results.table("shapes", "pictures_shapes_128").splitlines()[-1].split(" | ")[3]
    assert stated == [views["| the code", "attractor", "own box"].split()[0], f"{exact.split()[0]}%", f"{seconds} s",
                      f"{int(recovered[0]) / int(recovered[1]):.0%}", shapes]


def test_each_part_that_can_be_left_out_says_what_is_missing_and_by_which_setting():
    parts = [line.split(" | ") for line in results.table("parts").splitlines()[2:]]
    assert len(parts) == len(list((ROOT / "conf" / "without").glob("*.yaml"))) - 1   # `nothing` leaves nothing out
    assert all(about.endswith(".") and "=" in settings for _, about, settings in parts)


def test_the_method_fits_into_a_box_and_five_thousand_words():
    page = (DOCS / "method.md").read_text()
    assert len(page.split()) <= 5000
    box = page[:page.index("## ")].split("```")[1]
    assert 35 <= len(box.splitlines()) <= 50 and max(map(len, box.splitlines())) <= 88


def test_a_component_that_may_be_absent_has_its_table_too():
    class Whole(BaseModel):
        descent: Descent | None = None

    assert tables(Whole) == """\
**`descent`**: A descent.

| name | default | range | meaning |
| --- | --- | --- | --- |
| `descent.steps` | required | ≥~1 | Steps. |
| `descent.rate` | `0.5` |  | Rate. |"""


def test_a_link_to_a_code_gets_one_to_its_page():
    assert hooks.on_page_markdown("found ([code](codes/fern.json))") == (
        "found ([code](codes/fern.json), [fly through it](codes/fern.html))")
    page = hooks.code_page(DOCS / "codes" / "fern.json")
    assert "<title>Barnsley&#x27;s fern (black spleenwort)</title>" in page and len(page) < 200_000


def test_the_gallery_shows_one_code_as_a_page_and_links_to_all():
    page = (DOCS / "gallery.md").read_text()
    [frame] = re.findall(r"<iframe ([^>]+)>", page)
    name = re.search(r'src="codes/(\w+)\.html"', frame)[1]
    assert (DOCS / "codes" / f"{name}.json").exists() and 'loading="lazy"' in frame and "title=" in frame
    linked = re.findall(r"\[code\]\(codes/(\w+)\.json\)", page)
    assert sorted(linked) == sorted(path.stem for path in (DOCS / "codes").glob("*.json"))


def test_what_nobody_documents_is_named():
    @dataclass(frozen=True)
    class Part:
        pass

    class Bare(BaseModel):
        number: int = 3

    class Whole(BaseModel):
        part: Part = Part()

    with pytest.raises(ValueError, match="number has no description"):
        hooks.parameter_tables(Bare)
    with pytest.raises(ValueError, match="Part has no docstring"):
        hooks.parameter_tables(Whole)


def test_formulas_become_mathml_with_their_numbers():
    pytest.importorskip("latex2mathml", reason="formulas need `pip install 'fractal-exp[docs]'`")
    page = hooks.on_page_content('<p><span class="arithmatex">\\(a &lt; b_1\\)</span></p>'
                                 '<div class="arithmatex">\\[\nc = \\sqrt{d} \\tag{7}\n\\]</div>')
    assert page.count("<math") == 2 and "<msub>" in page and "<msqrt>" in page and "&#x0003C;" in page
    assert '<span class="number">(7)</span>' in page and "\\" not in page


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built strictly."""
    pytest.importorskip("mkdocs", reason="the site needs `pip install 'fractal-exp[docs]'`")
    folder = tmp_path_factory.mktemp("site")
    built = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", folder], cwd=ROOT,
                           capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.mark.slow
def test_the_site_builds_strictly_and_shows_formulas_and_signatures(site):
    assert "<math" in (site / "method.html").read_text() and "[table:" not in (site / "results.html").read_text()
    assert "points_in_view" in (site / "api.html").read_text()
    assert not (site / "hooks.py").exists()
    linked = re.findall(r'href="(codes/\w+\.html)"', (site / "gallery.html").read_text())
    assert len(linked) == len(list((DOCS / "codes").glob("*.json"))) > 5
    framed = re.findall(r'<iframe src="([^"]+)"', (site / "gallery.html").read_text())
    assert len(framed) == 1 and all('<canvas id="picture"' in (site / name).read_text() for name in linked + framed)


@pytest.mark.slow
def test_no_page_loads_anything_from_another_host(site):
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 15
    for page in pages:
        text = page.read_text()
        loaded = re.findall(r"<(?:script|link|img|iframe|source)\b[^>]*(?:src|href)=\"((?:https?:)?//[^\"]*)", text)
        assert loaded == [] and 'class="mermaid"' not in text, page.name  # the theme would fetch mermaid
    for sheet in site.rglob("*.css"):
        assert re.findall(r"(?:url\(|@import )[\"']?(?:https?:)?//[^)\"']*", sheet.read_text()) == [], sheet.name


@pytest.mark.slow
@pytest.mark.parametrize("page", [*EXTENDING, *(DOCS / f"{name}.md" for name in (
    "datasets", "evaluation", "formats", "your_codes"))], ids=lambda page: page.stem)
def test_the_code_of_a_page_runs(page, tmp_path):
    """A block with a title is a file; other Python blocks run as one program, shell blocks one after another."""
    program, commands = "", []
    for language, title, text in BLOCK.findall(page.read_text()):
        if title:
            (tmp_path / title).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / title).write_text(text)
        elif language == "python":
            program += text
        elif language == "sh":
            commands.append(text)
    (tmp_path / "program.py").write_text(program)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for command in (f"{sys.executable} program.py", *commands):
        ran = subprocess.run(["bash", "-euc", command], cwd=tmp_path, env=os.environ | {"PATH": path},
                             capture_output=True, text=True)
        assert ran.returncode == 0, f"{command}\n{ran.stderr}"


@pytest.mark.slow
def test_the_quick_start_runs_on_a_picture(tmp_path):
    from fractal_exp import codes, suite
    from fractal_exp.images import write_image

    write_image(tmp_path / "leaf.png", suite.target(codes.known("maple_leaf"), 256))
    page = (DOCS / "quickstart.md").read_text()
    program = "".join(text for language, _, text in BLOCK.findall(page) if language == "python")
    ran = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert "F1 0.9" in ran.stdout and "maps" in ran.stdout
    assert (tmp_path / "leaf.json").exists() and (tmp_path / "leaf-overlay.png").exists()
