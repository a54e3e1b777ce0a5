"""Fractint's `.ifs` files: the grammar of its documentation, files as the field types them, and broken ones."""

from dataclasses import replace

import pytest
import torch

from fractal_exp import IFS, InputError, codes

# Typed after the examples of Fractint's and the IFS Construction Kit's documentation.
FIELD = """\
 This line is of no entry.

 fern { ; The classic  fern
        ; by M. Barnsley { with a brace }
    0    0    0  .16 0   0   .01   ; the stem
   .85  .04 -.04  .85 0  1.6 .85
   .2  -.26  .23  .22 0  1.6 .07
  -.15  .28  .26  .24 0  .44 .07
   }

3dfern (3D) { .00 .00 0 .0 .18 .0 0 0.0 0.00 0 0.0 0 1 }

comment { Anything may stand here, 1 2 three; even
 a semicolon. }

binary
 { ; the brace may come later
  .5  .0 .0 .5 -2.563477 -0.000003 .333333
  .5  .0 .0 .5  2.436544 -0.000003 .333333
  .0 -.5 .5 .0  4.873085  7.563492 .333333
 }
Levy {; without probabilities, with commas
   0.5, -0.5,  0.5,  0.5,  0,  0
   0.5,  0.5, -0.5,  0.5,  0.5,  0.5
}
Sierpinski Triangle {
   0.5  0  0  0.5  0  0  33
   0.5  0  0  0.5  0.5  0  33
   0.5  0  0  0.5  0.25  0.433  33 }
run { .5 0 0 .5 0 0 .25 .5 0 0 .5
 1e0 -0.0E+1 .75 }
"""


@pytest.fixture
def field(tmp_path):
    path = tmp_path / "field.ifs"
    path.write_bytes(FIELD.replace("\n", "\r\n").encode() + b"\x1a")  # as DOS ended lines and files
    return path


def test_the_fern_of_the_field_is_the_classic(field):
    fern, classic = IFS.load(field, "fern"), codes.known("fern")
    assert torch.equal(fern.linear, classic.linear) and torch.equal(fern.offset, classic.offset)
    assert torch.equal(fern.probabilities, classic.probabilities)
    assert fern.meta == {"name": "fern", "comment": "The classic fern\nby M. Barnsley { with a brace }\nthe stem"}


def test_names_braces_commas_and_lines_may_stand_as_the_field_has_them(field):
    binary = IFS.load(field, "binary")
    assert len(binary) == 3 and float(binary.offset[2, 1]) == pytest.approx(7.563492)
    levy = IFS.load(field, "Levy")
    assert levy.probabilities is None and levy.linear[1].tolist() == [[0.5, 0.5], [-0.5, 0.5]]
    triangle = IFS.load(field, "Sierpinski Triangle")
    torch.testing.assert_close(triangle.probabilities, torch.full((3,), 1 / 3))
    run = IFS.load(field, "run")
    assert run.offset.tolist() == [[0, 0], [1, 0]] and run.probabilities.tolist() == [0.25, 0.75]


def test_an_entry_in_space_is_refused_by_name_and_comments_are_no_codes(field):
    with pytest.raises(InputError, match=r"entry '3dfern \(3D\)': is a code in space"):
        IFS.load(field, "3dfern")
    with pytest.raises(InputError, match="holds 6 codes; .*: 'fern', '3dfern', 'binary', 'Levy', 'Sierp"):
        IFS.load(field)
    with pytest.raises(InputError, match="no code called 'comment'"):
        IFS.load(field, "comment")


SPACE = " ".join(["0"] * 13)


@pytest.mark.parametrize(("text", "message"), [
    ("fern { .5 0 0 .5 0 0", "entry 'fern' does not end; close it with '}'"),
    ("fern { .5 0 0 .5 0 0\ntree {\n.5 0 0 .5 0 0 }", "entry 'fern' has a second '{'"),
    ("fern { }", "entry 'fern': has 0 numbers"), ("fern {\n.5 0 0 .5 0\n}", "entry 'fern': has 5 numbers"),
    ("fern {\n.5 0 0 .5 0 0 1\n.5 0 0 .5 0 0\n}", "has 13 numbers; a map is a line of 6"),
    (f"fern {{\n{SPACE}\n{SPACE}\n}}", "has 13 numbers a map, as codes in space do"),
    ("fern { .5 0 0 .5 0 nan }", "number 6 must be a number, got 'nan'"),
    ("fern { .5 0 0 .5 0 1_0 }", "number 6 must be a number, got '1_0'"),
    ("fern { .5 0 0 .5 0 x=3 }", "number 6 must be a number, got 'x=3'"),
    ("fern { .5 0 0 .5 0 1e999 }", "number 6 must be a finite number"),
    ("fern { .5 0 0 .5 0 1e39 }", "offset must be finite"),
    ("fern { 1.5 0 0 .5 0 0 }", "entry 'fern': every map must be contractive .*but map 0 has singular value 1.5"),
    ("fern { .5 0 0 .5 0 0 0 }", "weights must be at least 0, not all 0"),
    ("fern { .5 0 0 .5 0 0 -1 .5 0 0 .5 0 0 2 }", "weights must be at least 0"),
    ("fern { .5 0 0 .5 0 0 1e308 .5 0 0 .5 0 0 1e308 }", "weights must be"),
    ("no entry", "holds no code"), ("}{}", "entry '': has 0 numbers"), ("comment {fern}", "holds no code"),
    ("; fern { .5 0 0 .5 0 0 }", "holds no code"),
    ("<script>\x1b[31m { x }", r"entry '<script>\[31m': has 1 numbers"),
])
def test_a_broken_file_is_refused_with_the_remedy(tmp_path, text, message):
    path = tmp_path / "broken.ifs"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        IFS.load(path)
    assert str(error.value).startswith(str(path)) and str(error.value).isprintable()


def test_a_broken_entry_does_not_close_the_others(tmp_path):
    (tmp_path / "a.ifs").write_text("bad { x y }\ngood { .5 0 0 .5 0 0 }")
    assert len(IFS.load(tmp_path / "a.ifs", "good")) == 1


def test_notes_are_written_as_comments_and_come_back(tmp_path):
    code = IFS([[[0.5, 0], [0, 0.5]]], [[0, 0]], meta={"name": "two words; {3D}", "title": "A half; {of it}",
                                                       "comment": "first\nsecond", "seed": 3})
    path = code.save(tmp_path / "a.ifs")
    assert path.read_text() == ("two_words_3D {\n  ; A half; {of it}\n  ; first\n  ; second\n  0.5 0 0 0.5 0 0 1\n}\n")
    back = IFS.load(path)
    assert back.meta == {"name": "two_words_3D", "comment": "A half; {of it}\nfirst\nsecond"}
    assert back.save(tmp_path / "b.ifs").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(("name", "written"), [(None, "code"), ("comment", "comment_"), ("ф", "code"),
                                               ("a(3D)", "a_3D")])
def test_every_name_can_be_written(tmp_path, name, written):
    code = IFS([[[0.5, 0], [0, 0.5]]], [[0, 0]], meta={} if name is None else {"name": name})
    assert IFS.load(code.save(tmp_path / "a.ifs")).meta["name"] == written


def test_the_smallest_and_largest_numbers_come_back(tmp_path):
    code = IFS([[[1e-30, -0.0], [3.4e-45, 0.1]]], [[3e38, -1 / 3]])
    back = IFS.load(code.save(tmp_path / "a.ifs"))
    assert torch.equal(back.linear, code.linear) and torch.equal(back.offset, code.offset)
    assert torch.equal(replace(back, probabilities=None).sampling_probabilities(), code.sampling_probabilities())
