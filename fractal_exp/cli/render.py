"""`fractal-render`: stills and zoom films of a code, and morphs of several. A plain command line, since there is
nothing to compose."""

from __future__ import annotations

import argparse

from .commands import CODE_HELP, FRAMES, LARGEST, ORDER_HELP, command, command_parser

MODES = ("occupancy", "density", "tone", "colour")

DESCRIPTION = """Draw a code: a still at any view and any zoom, or a film that zooms into it. Or draw several: a morph.

The canvas is [-1,1]², x to the right and y up; a code is brought to it first, its longer side from -0.75 to 0.75
(--frame own leaves it where it is). A view is a square window about --center of half side 1/zoom; a picture that is
not square shows all of it, and more along its longer side.

examples
  fractal-render fern fern.png                               the whole fern, 1024 pixels
  fractal-render leaf.json leaf.png --center 0.1 -0.3 --zoom 64
  fractal-render fern poster.png --size 16384 --bits 16      as large as a wall, in bounded memory
  fractal-render fern wide.png --size 1920x1080              width x height, of films too
  fractal-render fern sticker.png --transparent              to lay on anything
  fractal-render suite:7 dust.png --mode density             how often points come by, not only whether
  fractal-render leaf.json leaf.png --background "#fff8e7"   a code with colours, on paper; --mode occupancy: in white
  fractal-render heighway_dragon zoom.mp4 --zoom 1e6         a million times closer, in 12 seconds of film
  fractal-render fern tip.gif --size 360 --center 0.3 0.7    into the point of the fern nearest to (0.3, 0.7)
  fractal-render fern leaf.json morph.mp4                    from one code to another
  fractal-render fern spiral tree morph.webm --loop          through three codes and back to the first
  fractal-render fern tree frames/%04d.png                   a file for each frame, from frames/0001.png"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-render`. arguments: those of the process if None."""
    parser = command_parser("fractal-render", DESCRIPTION)
    parser.add_argument("code", nargs="+", help=f"{CODE_HELP}; several for a morph")
    parser.add_argument("out", help="file to write: .png for a still; .mp4, .webm, .gif, or a .png with %%04d in its "
                                    "name, for a film")
    parser.add_argument("--center", type=float, nargs=2, metavar=("X", "Y"),
                        help="middle of the view (default 0 0); of a film, where it zooms to (default: a point of the "
                             "attractor with much to see around it, by --seed)")
    parser.add_argument("--zoom", type=float, help="of the view (default 1); of a film, at its end (default 10000)")
    parser.add_argument("--size", metavar="PIXELS", help=f"a side, or WIDTHxHEIGHT, up to {LARGEST} (default 1024; "
                                                         "of a film 720)")
    parser.add_argument("--points", type=float, help="points in the view (default: 50 million at 1024², in proportion)")
    parser.add_argument("--supersample", type=int, help="parts of a pixel along each axis (default 8; not for density "
                                                              "and tone)")
    parser.add_argument("--mode", choices=MODES, help="what a pixel shows (default: colour for a code with colours, "
                                                      "tone for one that was found on grey levels, else occupancy)")
    parser.add_argument("--background", metavar="COLOUR", help="behind a drawing in colour: a name or #rrggbb "
                                                               "(default: the one it was found on, or black)")
    parser.add_argument("--frame", choices=FRAMES, default="canvas", help="bring the code to the canvas or not")
    parser.add_argument("--order", metavar="COLUMNS", help=ORDER_HELP)
    parser.add_argument("--seed", type=int, help="of the points of a still, and of a film's target (default 0)")
    still = parser.add_argument_group("stills")
    still.add_argument("--bits", type=int, choices=(8, 16), help="of grey levels (default 8)")
    still.add_argument("--transparent", action="store_true", default=None, help="white on nothing instead of on black")
    film = parser.add_argument_group("films")
    film.add_argument("--seconds", type=float, help="length (default 12; of a morph 4 from each code to the next)")
    film.add_argument("--fps", type=int, help="frames a second (default 30; of a GIF 25)")
    film.add_argument("--start-zoom", type=float, help="zoom of the first frame, about the middle (default 1); not for "
                                                       "morphs")
    film.add_argument("--loop", action="store_true", default=None, help="a morph returns to its first code")
    command("fractal-render", _draw, parser, arguments)


def _draw(options: argparse.Namespace) -> None:
    from .drawing import draw

    draw(options)
