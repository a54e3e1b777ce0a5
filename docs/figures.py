"""Makes the pictures of the documentation, with the project's own commands.

    python -m docs.figures fits      fit the classics of the gallery: docs/codes/, benchmarks/results/gallery.jsonl
    python -m docs.figures gallery   docs/images/gallery/: target, recovered code and two zooms, from the codes
    python -m docs.figures hero      docs/images/hero.png
    python -m docs.figures zoom      docs/images/zoom.webp, a film into a recovered code
    python -m docs.figures morph     docs/images/morph.webp, a film through several recovered codes
    python -m docs.figures stages    docs/images/stages.png: a target, and the code after each stage of collage search
    python -m docs.figures elsewhere docs/images/elsewhere.png: pictures from elsewhere, and what was found in them
    python -m docs.figures failures  docs/images/failures.png: pictures that others drew, on which collage search fails
    python -m docs.figures retina outputs/fits   docs/images/retina.png and docs/codes/retina.json, from `make run`

`python -m docs.paper_figures` makes those of the paper's studies.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from PIL import Image, ImageDraw, ImageFont, ImageSequence
from torch import Tensor

from benchmarks import record
from fractal_exp import IFS, View, codes, render, suite
from fractal_exp.ifs import attractor
from fractal_exp.rendering.sheets import comparison_strip, difference
from fractal_exp.rendering.tone import own_tone
from fractal_exp.rendering.zoom import rich_point

DOCS = Path(__file__).parent
ROOT = DOCS.parent
CODES, IMAGES = DOCS / "codes", DOCS / "images"
RECORD = ROOT / "benchmarks" / "results" / "gallery.jsonl"
SUITE = ROOT / "benchmarks" / "results" / "collage_2025_grey" / "codes.jsonl"
BIN = Path(sys.executable).parent

CLASSICS = ("fern", "maple_leaf", "heighway_dragon", "tree", "koch_snowflake", "rauzy", "gosper_island", "culcita",
            "spiral", "pentaflake", "levy_c_curve")
SUITE_GALLERY = (2, 11, 22, 23, 37, 53, 57, 62)
HERO = ("fern", 11, 23, 62, 37)
SPIRALS = ("spiral", 11, 22)      # flat maps: elsewhere than in the spiral's eye, deep zooms show nothing but stripes
HERO_ZOOM = 1000
ZOOMS = (16, 1024)
FILM = 23
FILM_CENTER = ("-0.1944408947", "0.7147514659")  # on the border: a film into an eye changes all over, and packs badly
MORPH = ("fern", "maple_leaf", "spiral", "tree")
LEVELS = 16                       # grey levels of a picture's palette
RESULTS = ROOT / "benchmarks" / "results"
# The sets, their folders of results, and which F1 within a pixel tells failures.
FAILURES = {"textbook": ("pictures_textbook_120s", "f1_truth"), "shapes": ("pictures_shapes", "f1_light")}
# A note, and the folder, the set and the picture.
ELSEWHERE = [("a drawing in colour", "pictures_textbook_120s", "textbook", "pentigree-6-red"),
             ("dots, as JPEG", "pictures_textbook_120s", "textbook", "maple_leaf_dots-red-jpeg"),
             ("a plant of six steps", "pictures_trees", "trees", "weed_6_jpeg"),
             ("a tree", "pictures_trees", "trees", "two_9_jpeg"),
             ("a flame", "pictures_tone_curves", "tone_curves", "heighway_dragon-flame"),
             ("a root, 128 maps", "pictures_shapes_128", "shapes", "root")]
RETINA = "a retina, 128 maps"
ELSEWHERE_ZOOM = 20
FAILED, MOST_FAILURES = 0.9, 8
STAGES_SUITE, STAGES_INDEX = 101, 7


@dataclass(frozen=True)
class Recovered:
    """A fractal of the gallery: the true code, and the code that collage search found in its image of 256²."""

    key: str | int
    name: str
    truth: IFS
    code: IFS

    def panels(self, side: int, zooms: tuple[float, ...]) -> list[np.ndarray]:
        """The target, the recovered code, and the recovered code at each zoom: (side, side, 3) uint8 each."""
        views = [View(), *(View(self.center(max(zooms)), zoom) for zoom in zooms)]
        drawn = [render(self.code, view, resolution=side, supersample=suite.TARGET_SUPERSAMPLE) for view in views]
        target = suite.target(self.truth, 256)
        return [np.asarray(picture_of(target).resize((side, side), Image.Resampling.LANCZOS).convert("RGB")),
                *(np.asarray(picture_of(image).convert("RGB")) for image in drawn)]

    def center(self, zoom: float) -> tuple[float, float]:
        """Where to zoom: a point with much to see around it, or the fixed point of the largest map."""
        if self.key not in SPIRALS:
            return rich_point(self.code, end_zoom=zoom)
        largest = int(torch.linalg.det(self.code.linear).abs().argmax())
        linear, offset = self.code.linear[largest].double(), self.code.offset[largest].double()
        x, y = torch.linalg.solve(torch.eye(2, dtype=torch.float64) - linear, offset).tolist()
        return x, y


def classic(name: str) -> Recovered:
    """A classic and the code in docs/codes."""
    return Recovered(name, name, replace(codes.known(name), probabilities=None), IFS.load(CODES / f"{name}.json"))


def of_suite(index: int) -> Recovered:
    """A fractal of the random suite and the code in the suite's results."""
    code = json.loads(SUITE.read_text().splitlines()[index])["code"]
    return Recovered(index, f"suite-{index:03d}", suite.random_suite(index + 1)[index],
                     IFS(code["linear"], code["offset"], code.get("probabilities")))


def find(key: str | int) -> Recovered:
    return classic(key) if isinstance(key, str) else of_suite(key)


def fits() -> None:
    """Fit every classic of the gallery, judge the codes, and keep codes and scores."""
    with tempfile.TemporaryDirectory() as folder:
        for name in CLASSICS:
            _run("fractal-train", "method=collage", f"target.name={name}", "tracking=none", f"output={folder}",
                 "study=gallery", f"name={name}")
        keep_fits(Path(folder) / "gallery")


def keep_fits(folder: Path) -> None:
    """Judge the fits in a folder, and keep their codes and scores."""
    with tempfile.TemporaryDirectory() as judged:
        _run("fractal-evaluate", str(folder), "--out", judged)
        scores = pd.read_csv(Path(judged) / "codes.csv")
    CODES.mkdir(exist_ok=True)
    for name in CLASSICS:
        shutil.copy(folder / name / "code.json", CODES / f"{name}.json")
    for row in scores.to_dict("records"):
        record.append(RECORD, "gallery", row, {f"{row['fractal']}, F1": row["f1"]})


def gallery() -> None:
    """A strip of four panels for every fractal of the gallery."""
    (IMAGES / "gallery").mkdir(parents=True, exist_ok=True)
    for key in (*CLASSICS, *SUITE_GALLERY):
        each = find(key)
        panels = each.panels(240, ZOOMS)
        gap = np.full((240, 6, 3), 90, np.uint8)
        save(IMAGES / "gallery" / f"{each.name}.png",
              np.concatenate([part for panel in panels for part in (gap, panel)][1:], 1))


def hero() -> None:
    """A column for each of several fractals: target, recovered code, deep zoom."""
    side, gap, left = 230, 8, 118
    notes = ("one image,\n256 x 256", "the code\nfound in it", f"that code,\n{HERO_ZOOM} times\ncloser")
    sheet = Image.new("RGB", (left + len(HERO) * (side + gap), len(notes) * (side + gap) - gap))
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=20)
    for row, note in enumerate(notes):
        pen.multiline_text((12, row * (side + gap) + side // 2), note, fill=(205, 205, 205), font=font, anchor="lm")
    for column, key in enumerate(HERO):
        for row, panel in enumerate(find(key).panels(side, (HERO_ZOOM,))):
            sheet.paste(Image.fromarray(panel), (left + column * (side + gap), row * (side + gap)))
    save(IMAGES / "hero.png", np.asarray(sheet))


def elsewhere() -> None:
    """A column for each of several pictures that others drew: the picture, the code found in it, and that code closer.
    """
    from benchmarks.pictures import fitting
    from benchmarks.pictures.sets import SETS
    from fractal_exp.images.samples import retina_vessels

    side, gap, left, top = 190, 8, 118, 26
    notes = ("a picture", "the code\nfound in it", f"that code,\n{ELSEWHERE_ZOOM} times\ncloser")
    sheet = Image.new("RGB", (left + (len(ELSEWHERE) + 1) * (side + gap), top + len(notes) * (side + gap)))
    pen, font, small = ImageDraw.Draw(sheet), ImageFont.load_default(size=20), ImageFont.load_default(size=16)
    for row, note in enumerate(notes):
        middle = top + row * (side + gap) + side // 2
        pen.multiline_text((12, middle), note, fill=(205, 205, 205), font=font, anchor="lm")
    columns = [(RETINA, _bytes(retina_vessels(2 * side).numpy()), IFS.load(CODES / "retina.json"))]
    for note, folder, kind, name in ELSEWHERE:
        [line] = [each for each in fitting.read(RESULTS / folder) if each["picture"] == name]
        columns.append((note, SETS[kind].picture(name), fitting.code_of(line)))
    for column, (note, source, code) in enumerate(columns):
        drawn = Image.open(source) if isinstance(source, Path) else Image.fromarray(_bytes(source))
        closer = View(rich_point(code, end_zoom=ELSEWHERE_ZOOM), ELSEWHERE_ZOOM)
        cells = [_square(drawn.convert("RGB")), *(seen(code, view, 2 * side) for view in (View(), closer))]
        x = left + column * (side + gap)
        pen.text((x + side // 2, top - 6), note, fill=(205, 205, 205), font=small, anchor="ms")
        for row, cell in enumerate(cells):
            sheet.paste(cell.resize((side, side), Image.Resampling.BOX), (x, top + row * (side + gap)))
    save(IMAGES / "elsewhere.png", np.asarray(sheet), 32)


def zoom() -> None:
    """A film by `fractal-render`, packed as an animated WebP."""
    with tempfile.TemporaryDirectory() as folder:
        code, film = Path(folder) / "code.json", Path(folder) / "zoom.gif"
        of_suite(FILM).code.save(code)
        _run("fractal-render", str(code), str(film), "--size", "320", "--seconds", "8", "--fps", "12", "--zoom", "1e5",
             "--frame", "own", "--center", *FILM_CENTER)
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(Image.open(film))]
        frames[0].save(IMAGES / "zoom.webp", save_all=True, append_images=frames[1:], duration=1000 // 12, loop=0,
                       quality=30, method=6)


def morph() -> None:
    """A film by `fractal-render`, as numbered pictures, packed as an animated WebP."""
    with tempfile.TemporaryDirectory() as folder:
        _run("fractal-render", *(str(CODES / f"{name}.json") for name in MORPH), f"{folder}/%03d.png", "--loop",
             "--size", "288", "--seconds", "12", "--fps", "12")
        frames = [Image.open(path).convert("RGB") for path in sorted(Path(folder).glob("*.png"))]
        frames[0].save(IMAGES / "morph.webp", save_all=True, append_images=frames[1:], duration=1000 // 12, loop=0,
                       quality=30, method=6)


def stages() -> None:
    """Columns: the truth, and the code after each stage. Rows: whole, four times closer, and where that differs."""
    from fractal_exp.methods import load

    truth = attractor.normalize(suite.random_suite(STAGES_INDEX + 1, STAGES_SUITE)[STAGES_INDEX])
    found: dict[str, IFS] = {}

    def keep(progress) -> None:  # noqa: ANN001
        if progress.code is not None:
            found[progress.stage] = progress.code

    load("collage")(resolution=256).reconstruct(suite.target(truth, 256), on_step=keep)
    views = View(), View(center=(-0.2, -0.15), zoom=4.0)
    columns = [truth, *list(found.values())[:3]]
    images = [[render(code, view, resolution=400, seed=number) for number, code in enumerate(columns)]
              for view in views]
    cells = [np.asarray(picture_of(image).convert("RGB")) for row in images for image in row]
    close = images[1]
    cells += [np.zeros_like(cells[0]), *(np.rint(255 * difference(image, close[0])).astype(np.uint8)
                                         for image in close[1:])]
    side = 200
    cells = [np.asarray(Image.fromarray(cell).resize((side, side), Image.Resampling.BOX)) for cell in cells]
    rows = [np.concatenate(cells[k:k + len(columns)], 1) for k in range(0, len(cells), len(columns))]
    save(IMAGES / "stages.png", np.concatenate(rows), 24)


def failures() -> None:
    """Input, result and difference of the picture with the lowest F1 of each family, lowest first."""
    from benchmarks.pictures import fitting, report

    worst = {}
    for kind, (folder, score) in FAILURES.items():
        for line in fitting.read(RESULTS / folder):
            family = line.get("family", line["picture"])
            if line["role"] == "reporting" and line[score] < min(FAILED, worst.get(family, (FAILED,))[0]):
                worst[family] = line[score], kind, line
    chosen = sorted(worst.values(), key=lambda each: each[0])[:MOST_FAILURES]
    save(IMAGES / "failures.png", report.sheet([(kind, line) for _, kind, line in chosen], 180), 32)


def retina(folder: Path) -> None:
    """Target, result and difference of the fit of the retina's vessels; and its code."""
    fit = next(folder.glob("retina-collage-*-laptop-*"))
    image, truth = (torch.from_numpy(np.asarray(Image.open(fit / name).convert("L")) / np.float32(255))
                    for name in ("redrawn.png", "views/target.png"))
    save(IMAGES / "retina.png", comparison_strip(image[None], truth[None], ["blood vessels of a retina"]), 64)
    shutil.copy(fit / "code.json", CODES / "retina.json")


def seen(code: IFS, view: View, side: int) -> Image.Image:
    """A code as `fractal-render` shows it: in its own tone, if it has one."""
    if own_tone(code) is None:
        return picture_of(render(code, view, resolution=side))
    return Image.fromarray(_bytes(render(code, view, resolution=side, mode="tone").numpy()))


def picture_of(image: Tensor) -> Image.Image:
    """A grey image (R,R) in [0,1]. The square root lifts the faint parts, which a small picture would lose."""
    return Image.fromarray((image.sqrt() * 255).round().to(torch.uint8).numpy())


def _bytes(image: np.ndarray) -> np.ndarray:
    """The pixels of a picture as bytes; numbers that are none are in [0,1]."""
    return image if image.dtype == np.uint8 else np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)


def _square(picture: Image.Image) -> Image.Image:
    """The picture on a square of the colour of its corner."""
    side = max(picture.size)
    square = Image.new("RGB", (side, side), picture.getpixel((0, 0)))
    square.paste(picture, ((side - picture.width) // 2, (side - picture.height) // 2))
    return square


def save(path: Path, image: np.ndarray, colours: int = LEVELS) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).quantize(colours, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1024:.0f} KiB")


def _run(command: str, *arguments: str) -> None:
    subprocess.run([BIN / command, *arguments], check=True)


if __name__ == "__main__":
    parts = {"fits": fits, "gallery": gallery, "hero": hero, "zoom": zoom, "morph": morph, "stages": stages,
             "elsewhere": elsewhere, "failures": failures, "retina": retina}
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    parts[sys.argv[1]](*map(Path, sys.argv[2:]))
