"""The page's readers and writers beside the package's: the same files, whole, broken and hostile, the same answers."""

import json
import random
import shutil
import subprocess
from pathlib import Path

import pytest
import torch
from format_files import BROKEN_FLAMES, BROKEN_FRACTINT, FLAME, FRACTINT, SLOW_TO_WRITE, million

from fractal_exp import IFS, InputError, codes
from fractal_exp.ifs import formats
from fractal_exp.suite import random_suite
from fractal_exp.viewer.page import MOST_MAPS

READER = Path(__file__).parents[1] / "browser" / "read_codes.mjs"
SUFFIX = {"json": ".json", "rows": ".json", "lists": ".json", "fractint": ".ifs", "flame": ".flame"}
MUTANTS = 250  # of each whole file
pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="node is not installed: it runs the page's readers")


def in_the_page(files):
    """What the page's readers answer to each of [(file name, text, number of the code)]."""
    done = subprocess.run(["node", READER], input=json.dumps(files), capture_output=True, text=True, check=True)
    answers = json.loads(done.stdout)
    assert len(answers) == len(files)
    return answers


def in_python(file, text, choice=0):
    """The names of a file's codes and the chosen one, or the reason why there is none."""
    try:
        entries = formats.suffixes()[Path(file).suffix].entries(text.encode())
        if not entries:
            raise InputError("the file holds no code")
        return [entry.name for entry in entries], entries[choice].read()
    except InputError as error:
        return str(error)


def check_alike(file, text, choice, answer):
    """Both read the same code, or both refuse."""
    here = f"{file} {text[:300]!r}: {json.dumps(answer)[:300]}"
    assert "broken" not in answer, here
    expected = in_python(file, text, choice)
    if isinstance(expected, str):
        assert "refused" in answer, f"{here}, not {expected}"
        return
    names, code = expected
    assert "rows" in answer, here
    assert answer["names"] == names, here
    rows = torch.cat([code.linear.reshape(-1, 4), code.offset], 1)
    torch.testing.assert_close(torch.tensor(answer["rows"], dtype=torch.float32), rows, rtol=1e-6, atol=1e-30, msg=here)
    assert (answer["probabilities"] is None) == (code.probabilities is None), here
    if code.probabilities is not None:
        chances = torch.tensor(answer["probabilities"], dtype=torch.float32)
        torch.testing.assert_close(chances, code.probabilities, rtol=1e-6, atol=0)
    assert answer["meta"] == code.meta, here


HOSTILE_JSON = [
    "", "   ", "{", "[", "null", "true", "3", '"fern"', "[]", "[[]]", "{}", "[1, 2]", "\ufeff[[0,0,0,0,0,0]]",
    "[[0,0,0,0,0]]", "[[0,0,0,0,0,0],[0,0,0,0,0]]", "[[0,0,0,0,0,0,1,1]]", "[[0,0,0,0,0,NaN]]", "[[0,0,0,0,0,1e999]]",
    "[[0,0,0,0,0,1e39]]", "[[0,0,0,0,0,Infinity]]", '[[0,0,0,0,0,"1"]]', "[[0,0,0,0,0,true]]", "[[0,0,0,0,0,null]]",
    "[[[0],[0],[0],[0],[0],[0]]]", "[[1,0,0,1,0,0]]", "[[0.5,0,0,1.5,0,0]]", "[[0,0,0,0,0,0,0.5]]",
    "[[0,0,0,0,0,0,-1],[0,0,0,0,0,0,2]]", '{"ifs_m": [[0,0,0,0]]}', '{"ifs_m": [[0,0,0]], "ifs_t": [[0,0]]}',
    '{"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0],[0,0]]}', '{"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0]], "x": 1}',
    '{"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0]], "ifs_p": [0.5, 0.5]}', '{"ifs_m": [], "ifs_t": []}',
    '{"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0]], "ifs_t": [[1,1]]}',
    '{"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0]], "\\u0069fs_t": [[1,1]]}',
    '{"linear": [[[0,0],[0,0]]], "offset": [[0,0]]}',
    '{"format": "fractal-exp/ifs", "version": 2, "linear": [[[0,0],[0,0]]], "offset": [[0,0]]}',
    '{"format": "fractal-exp/ifs", "version": true, "linear": [[[0,0],[0,0]]], "offset": [[0,0]]}',
    '{"format": "fractal-exp/ifs", "version": 1, "linear": [[[0,0],[0,0]]]}',
    '{"format": "fractal-exp/ifs", "version": 1, "linear": [[0,0,0,0]], "offset": [[0,0]]}',
    '{"format": "fractal-exp/ifs", "version": 1, "linear": [[[0,0],[0,0]]], "offset": [[0,0]], "meta": [1]}',
    '{"format": "fractal-exp/ifs", "version": 1, "linear": [[[0,0],[0,0]]], "offset": [[0,0]], "probabilities": [2]}',
    '{"format": "fractal-exp/ifs", "version": 1, "linear": 3, "offset": [[0,0]], "<script>": "alert(1)"}',
    '{"__proto__": {"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0]]}}', "[" * 100_000, "[" * 100_000 + "]" * 100_000,
    '{"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0]], "a": ' + '{"a": ' * 50_000 + "1" + "}" * 50_001,
    "<script>alert(1)</script>", "fern { .5 0 0 .5 0 0 }",
]
GOOD_JSON = [
    "[[0.5,0,0,0.5,0,0]]", "[[0.5,0,0,0.5,1,2,0.25],[0.1,0.2,-3e-1,0.4,5E0,-0.0,0.75]]",
    '{"ifs_m": [[0.5,0,0,0.5]], "ifs_t": [[1,2]]}', '{"ifs_m": [[[0.5,0],[0,0.5]]], "ifs_t": [[1,2]], "ifs_p": [1]}',
    '{"ifs_m": [[0.5,0,0,0.5]], "ifs_t": [[1,2]], "ifs_p": null}',
    '{"format": "fractal-exp/ifs", "version": 1, "linear": [[[0.1,0],[0,0.7]]], "offset": [[0,1e30]], "meta": '
    '{"name": "<img src=x onerror=alert(1)>", "title": "a \\" : { } [ ] , title", "deep": [{"a": 1}, {"a": 2}]}}',
]
BROKEN_XML = [
    '<flame name="a" name="b"/>', "<flame a=1/>", "<flame a='<'/>", "<flame>]]></flame>", "<flame>&#0;</flame>",
    "<flame>&#x110000;</flame>", "<flame>&lt</flame>", "<flame>&</flame>", "<flame/><flame/>", "<flame/>x", "x<flame/>",
    " <?xml version='1.0'?><flame/>", "<?xml version='1.0'?><?xml version='1.0'?><flame/>", "<?XML a?><flame/>",
    "<flame><!-- a -- b --></flame>", "<flame><!-- a --->", "<flame><![CDATA[ a </flame>", "<![CDATA[a]]><flame/>",
    "<flame></flam>", "<flame a='1'b='2'/>", "<flame / >", "< flame/>", "<1/>", "<?xml?><flame/>",
    "<?xml version='1.0' standalone='maybe'?><flame/>", "<flame>\x01</flame>", "<flame>\uffff</flame>", "<flame><?",
    '<?xml version="1.0" encoding="latin-1"?><flame><xform weight="1" linear="1" coefs=".5 0 0 .5 0 0"/></flame>x',
]
BODY = '<xform weight="1" linear="1" coefs=".5&#32;0 0&#x9;.5\n0 0"/>'
GOOD_XML = [
    f"<flame>{BODY}</flame>",
    f"<?xml version='1.0' encoding='UTF-8' standalone='yes' ?>\n<flame>{BODY}</flame>\n<!-- x -->",
    f"<a><!-- <!DOCTYPE x> --><flame name='&lt;&amp;&#233;&quot;\t\n x'>{BODY}<palette><![CDATA[<!DOCTYPE]]></palette>"
    "</flame></a>",
    f"\ufeff<?xml version='1.0'?><flame><?php <flame> ?>{BODY}</flame\n>\x1a",
    f"<flame\r\nname\r=\r\n'é'>{BODY}</flame>",
]


def whole_files():
    """[(file name, text, number of the code)] that both read, in every format."""
    found = []
    for code in [codes.known("fern"), codes.known("tree"), codes.known("heighway_dragon"), *random_suite(3)]:
        found += [(f"a{SUFFIX[key]}", formats.FORMATS[key].write([code]).decode(), 0) for key in SUFFIX]
    found += [("a.ifs", FRACTINT + "\x1a", k) for k in (0, 2, 3, 4, 5)]
    found += [("a.flame", FLAME, k) for k in (0, 1)]
    return found + [("a.json", text, 0) for text in GOOD_JSON] + [("a.flam3", text, 0) for text in GOOD_XML]


def test_whole_files_are_read_alike():
    files = whole_files()
    for file, answer in zip(files, in_the_page(files), strict=True):
        assert "rows" in answer, (file, answer)
        check_alike(*file, answer)


def test_broken_and_hostile_files_are_refused_alike():
    files = [("a.json", text, 0) for text in HOSTILE_JSON] + [("a.flame", text, 0) for text in BROKEN_XML]
    files += [("a.flame", text, 0) for text, _ in BROKEN_FLAMES] + [("a.ifs", text, 0) for text, _ in BROKEN_FRACTINT]
    files += [("a.ifs", FRACTINT, 1), ("a.flame", FLAME, 2)]
    for file, answer in zip(files, in_the_page(files), strict=True):
        check_alike(*file, answer)
        assert "refused" in answer, (file, answer)
        assert answer["refused"].isprintable() and len(answer["refused"]) < 500, answer


@pytest.mark.parametrize("suffix", [".json", *SLOW_TO_WRITE])
def test_a_million_maps_are_refused_in_the_page(suffix):
    (answer,) = in_the_page([(f"big{suffix}", million(suffix), 0)])
    assert f"a page shows a code of at most {MOST_MAPS} maps, got 1" in answer["refused"]


def mutants(files, seed):
    """Files in which some letters are lost, or replaced by some that have a meaning."""
    meant = ["", *'<>/&;"\'={}[]:,.-+eE0159 \n\t!?#', "<!--", "-->", "]]>", "<a/>", "&amp;", "&#48;", "NaN", "\x00"]
    rng = random.Random(seed)
    for file, text, choice in files:
        for _ in range(MUTANTS):
            letters = list(text)
            for _ in range(rng.choice([1, 1, 2, 5])):
                at = rng.randrange(len(letters))
                letters[at:at + rng.choice([0, 1, 1, 3])] = rng.choice(meant)
            yield file, "".join(letters), choice


def test_damaged_files_are_read_or_refused_alike():
    keys, small = ("json", "rows", "fractint"), codes.known("tree")
    whole = [(f"a{SUFFIX[key]}", formats.FORMATS[key].write([small]).decode(), 0) for key in keys]
    whole += [("a.json", GOOD_JSON[-1], 0), ("a.ifs", FRACTINT, 2)]
    whole += [("a.flame", FLAME, 0), *(("a.flame", text, 0) for text in GOOD_XML)]
    files = list(mutants(whole, 5))
    read = 0
    for file, answer in zip(files, in_the_page(files), strict=True):
        check_alike(*file, answer)
        read += "rows" in answer
    assert 0.1 < read / len(files) < 0.9


@pytest.mark.parametrize("key", SUFFIX)
def test_what_the_page_writes_the_package_reads(key):
    extreme = IFS([[[1e-30, -0.0], [3.4e-45, 0.1]]], [[3e38, -1 / 3]], None, {"name": "<&'\"> ф\n}", "title": "; }"})
    given_codes = [codes.known("fern"), codes.known("sierpinski_carpet"), *random_suite(4), extreme]
    files = [("a.json", formats.FORMATS["json"].write([code]).decode(), 0) for code in given_codes]
    for code, answer in zip(given_codes, in_the_page(files), strict=True):
        names, back = in_python(f"a{SUFFIX[key]}", answer["written"][key])
        assert torch.equal(back.linear, code.linear) and torch.equal(back.offset, code.offset)
        if code.probabilities is not None:
            assert torch.equal(back.probabilities, code.probabilities)
        elif key in ("fractint", "flame"):
            torch.testing.assert_close(back.probabilities, code.sampling_probabilities(), rtol=1e-6, atol=0)
        else:
            assert back.probabilities is None
        _, twin = in_python(f"a{SUFFIX[key]}", formats.FORMATS[key].write([code]).decode())
        assert names[0] == twin.meta.get("name") if key in ("fractint", "flame") else back.meta == twin.meta
