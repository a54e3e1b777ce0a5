"""Fractint's `.ifs` files: the grammar of its documentation, files as the field types them, and broken ones."""


import pytest
import torch
from format_files import FRACTINT

from fractal_exp import IFS, InputError, codes


@pytest.fixture
def field(tmp_path):
    path = tmp_path / "field.ifs"
    path.write_bytes(FRACTINT.replace("\n", "\r\n").encode() + b"\x1a")  # as DOS ended lines and files
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


def test_notes_are_written_as_comments_and_come_back(tmp_path):
    code = IFS([[[0.5, 0], [0, 0.5]]], [[0, 0]], meta={"name": "two words; {3D}", "title": "A half; {of it}",
                                                       "comment": "first\nsecond", "seed": 3})
    path = code.save(tmp_path / "a.ifs")
    assert path.read_text() == ("two_words_3D {\n  ; A half; {of it}\n  ; first\n  ; second\n  0.5 0 0 0.5 0 0 1\n}\n")
    back = IFS.load(path)
    assert back.meta == {"name": "two_words_3D", "comment": "A half; {of it}\nfirst\nsecond"}
    assert back.save(tmp_path / "b.ifs").read_bytes() == path.read_bytes()
