"""`fractal-evaluate`: codes against their truths. A plain command line, since there is nothing to compose."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import InputError
from .commands import command, command_parser, refuse_idle
from .reading import add_reading

SCALES = {"laptop": {"resolution": 256, "views": "attractor"}, "paper": {"resolution": 1024, "views": "released"}}
VIEWS, ALIGNMENTS = ("attractor", "released", "uniform"), ("bbox", "none")
DISTANCES = ("lpips_alex", "lpips_squeeze", "lpips_vgg", "fractal")
AS_READ = "threshold", "crop", "frame", "levels", "as_it_is"
IDLE = {  # options that change nothing, by what is compared
    "codes with codes": ("invert", *AS_READ),
    "codes with a picture": ("points", "views", "device", "cache"),
    "pictures": ("scale", "resolution", "points", "views", "align", "device", "cache", "track", *AS_READ)}

DESCRIPTION = """Judge recovered codes on the seven views of each fractal: the whole, and closer by up to eight times.

CODES are files (FILE:NAME or FILE:#2 for one of several), names of classics, folders of JSON files, folders of fits as
fractal-train leaves them or of an inversion, or run:ID. Fits know their truth; for other codes name it: --truth suite
takes the fractal whose number ends the file's name (007.json), a folder the file of the same name in it, and a code
(fern, leaf.json, suite:7) stands for all. A classic's name means that classic with map probabilities |det| + 0.01, as
target=known draws it unless told otherwise.

Written to --out: per_view (.csv and .parquet, a row a view), summary and codes (.csv), report.txt, and for each code a
strip target | result | difference. Beside the results stand their ceiling, which is the truth drawn with other
random points, and what an all white and an all black picture would get.
With --published FOLDER the codes are those that the authors of the paper found for their own data set, as their project
page offers both. Their means stand beside the paper's own in the report and in published.csv. FOLDER holds the data
set: ifs_codes/fdb_0.json, … and ifs/fdb_0.png, …; and, if no other folder is named, the optimised codes:
fdb_0/output/best_optimized_ifs_code.pth, … or fdb_0.pth, …

A fit of a picture has no truth. It is judged against its input, on the whole view, at the input's own resolution; that
stands apart, in inputs.csv and in a part of the report of its own.
Where --truth is a picture, each code is placed on its canvas, by --align, and drawn as the picture was drawn. The
picture is read as fractal-invert reads it, at --resolution, and all pixels are compared: inputs.csv. If CODES are
pictures too, they have its size, and all pixels are compared as they are: pictures.csv.

examples
  fractal-evaluate outputs/fits                                   all finished fits of a study
  fractal-evaluate mine/*.json --truth suite --scale paper
  fractal-evaluate leaf.json --truth fern --align none            do not shift or scale the code
  fractal-evaluate --published chaotic_fractals                   the authors' codes, beside their figures
  fractal-evaluate leaf.json --truth leaf.png                     a code against the picture that it should show
  fractal-evaluate drawing.png --truth leaf.png                   a picture against a picture
  fractal-evaluate run:3fa0… --track judgements                   a run of the store in outputs, logged as another"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-evaluate`. arguments: those of the process if None."""
    parser = command_parser("fractal-evaluate", DESCRIPTION)
    parser.add_argument("codes", nargs="*", help="what to judge")
    parser.add_argument("--published", metavar="FOLDER", help="judge the paper's own codes, from its project page, at "
                                                              "--scale paper")
    parser.add_argument("--truth", help="what it ought to be (default: what the fits' records say)")
    parser.add_argument("--out", default="evaluation", help="folder to write to")
    parser.add_argument("--scale", choices=SCALES, help="laptop: 256² pixels and views=attractor (default); paper: "
                                                        "1024² and views=released")
    parser.add_argument("--resolution", type=int, help="pixels a side, instead of the scale's")
    parser.add_argument("--points", type=int, help="points in a view, instead of 50 million · (resolution / 1024)²")
    parser.add_argument("--views", metavar=f"{{{','.join(VIEWS)}}}",
                        help="instead of the scale's: centred on points of the true attractor; towards the middle of "
                             "the canvas as in the authors' program, to stand beside published figures; or anywhere "
                             "on the canvas")
    parser.add_argument("--align", choices=ALIGNMENTS, default="bbox", help="frame each code by its own bounding box, "
                                                                            "or take it in the frame of the input")
    parser.add_argument("--perceptual", choices=("none", *DISTANCES), default="none",
                        help="a perceptual distance to add")
    parser.add_argument("--perceptual-weights", metavar="FILE", help="its weights (default: those of fractal come with "
                                                                     "the package, those of LPIPS from torch's cache, "
                                                                     "else a download)")
    parser.add_argument("--device", default="cpu", help="where codes are drawn: cpu, or cuda with an NVIDIA GPU")
    parser.add_argument("--cache", metavar="FOLDER", help="keep the truths' images here, for the next evaluation")
    parser.add_argument("--track", metavar="STUDY", help="log to this study of the MLflow store in --output")
    parser.add_argument("--output", default="outputs", help="folder of the MLflow store")
    add_reading(parser.add_argument_group("how a picture is read"))
    command("fractal-evaluate", lambda options: _evaluate(options, parser), parser, arguments)


def _evaluate(options: argparse.Namespace, parser: argparse.ArgumentParser) -> None:
    from .code_names import is_picture, names_picture

    if options.published is None and not options.codes:
        raise InputError("name what to judge: files, folders or run:ID")
    if options.published is not None:
        if options.truth or options.views not in (None, "released"):
            raise InputError("--published has truths of its own and needs --views released, on which the paper's "
                             "figures are; leave out --truth and --views")
        options.views, options.scale = "released", options.scale or "paper"
    is_drawn = options.truth is not None and is_picture(Path(options.truth))
    pictures = [name for name in options.codes if names_picture(name)] if is_drawn else []
    if pictures and len(pictures) < len(options.codes):
        other = next(name for name in options.codes if name not in pictures)
        raise InputError(f"{pictures[0]} is a picture and {other} is none, and they are compared with a picture in "
                         "different ways; judge pictures and codes one after another")
    what = "pictures" if pictures else "codes with a picture" if is_drawn else "codes with codes"
    refuse_idle(options, dict.fromkeys(IDLE[what], f"changes nothing where {what} are compared"), parser.get_default)
    if pictures:
        from .pictures import evaluate_pictures

        evaluate_pictures(options)
        return
    from .judgements import evaluate_codes

    options.scale = options.scale or "laptop"
    for name, value in SCALES[options.scale].items():
        setattr(options, name, value if getattr(options, name) is None else getattr(options, name))
    evaluate_codes(options)
