"""Files that are often mistaken for pictures: what they are, by content or name, and what to do with them."""

from __future__ import annotations

import re
from pathlib import Path

HEAD_BYTES = 4096
VIDEO = "a video; save one of its frames as a picture (ffmpeg -i {name} -frames:v 1 frame.png)"
DRAWING = "a vector drawing (SVG); export it as a PNG of about 1000 px a side"
DOCUMENT = "a PDF; export the page or the figure as a PNG of about 1000 px a side"
PHONE = "a picture of a kind that is not read (HEIF or AVIF); save it as PNG or JPEG"
LAYERED = "a Photoshop file; export it as PNG"
CONTENTS = (  # patterns of the first bytes
    (rb"....ftyp(?:heic|heix|heim|heis|hevc|mif1|msf1|avif|avis)", PHONE),
    (rb"....(?:ftyp|moov|mdat|wide|free)", VIDEO),                       # MP4, QuickTime
    (rb"\x1aE\xdf\xa3|RIFF....AVI |FLV\x01|\x00\x00\x01[\xb3\xba]|0&\xb2u\x8ef\xcf\x11", VIDEO),  # WebM, AVI, …, WMV
    (rb"\s*%PDF-", DOCUMENT),
    (rb"8BPS", LAYERED),
    (rb"(?:\xef\xbb\xbf)?\s*<(?:svg|(?:\?xml|!DOCTYPE|!--).*?<svg)\b", DRAWING),
)
SUFFIXES = {
    **dict.fromkeys((".mp4", ".m4v", ".mov", ".webm", ".mkv", ".avi", ".mpg", ".mpeg", ".wmv", ".flv", ".ogv"), VIDEO),
    **dict.fromkeys((".svg", ".svgz"), DRAWING),
    ".pdf": DOCUMENT,
    **dict.fromkeys((".heic", ".heif", ".avif"), PHONE),
    ".psd": LAYERED,
}


def known_as(path: Path) -> str | None:
    """What a file that is not a picture is, and the remedy; None if unknown."""
    try:
        with open(path, "rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError:
        return None
    told = next((said for pattern, said in CONTENTS if re.match(pattern, head, re.DOTALL | re.IGNORECASE)),
                SUFFIXES.get(path.suffix.lower()))
    return told and told.format(name=path.name)
