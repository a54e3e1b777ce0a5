"""Files that are no pictures are refused by what they are, with the remedy."""

import gzip

import pytest

from fractal_exp import InputError
from fractal_exp.images.reading import read_target

FILES = {
    "film.mp4": (b"\0\0\0\x20ftypisom\0\0\2\0isomiso2avc1mp41", "is a video; save one of its frames .*-i film.mp4 "),
    "film.mov": (b"\0\0\0\x14ftypqt  \0\0\0\0qt  ", "is a video"),
    "film.webm": (b"\x1aE\xdf\xa3\x9fB\x86\x81\x01", "is a video"),
    "film.avi": (b"RIFF\x10\0\0\0AVI LIST", "is a video"),
    "named.png": (b"\0\0\0\x20ftypisom\0\0\2\0isomiso2avc1mp41", "named.png is a video"),
    "damaged.mkv": (b"nothing that is known", "is a video"),
    "leaf.svg": (b'<?xml version="1.0"?>\n<!-- leaf -->\n<svg xmlns="x"/>', "vector drawing .SVG.; export it as a PNG"),
    "plain.svg": (b'<svg width="10" height="10"></svg>', "vector drawing"),
    "leaf.svgz": (gzip.compress(b"<svg/>"), "vector drawing"),
    "paper.pdf": (b"%PDF-1.7\n", "is a PDF; export the page or the figure as a PNG"),
    "paper.png": (b"%PDF-1.7\n", "paper.png is a PDF"),
    "phone.heic": (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "HEIF or AVIF.; save it as PNG or JPEG"),
    "layers.psd": (b"8BPS\0\1", "Photoshop file; export it as PNG"),
}


@pytest.mark.parametrize("name", FILES)
def test_it_is_refused_by_name(tmp_path, name):
    content, message = FILES[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_target(tmp_path / name, 64)
    assert "\n" not in str(caught.value) and str(tmp_path / name) in str(caught.value)


def test_other_xml_is_no_drawing(tmp_path):
    (tmp_path / "page.xml").write_text("<?xml version='1.0'?><html/>")
    with pytest.raises(InputError, match="not a picture of a supported format"):
        read_target(tmp_path / "page.xml", 64)
