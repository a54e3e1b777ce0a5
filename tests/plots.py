"""Plots of classic codes as people make them, by matplotlib and Pillow, each also without anything beside the shape."""

import io
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fractal_exp import codes
from fractal_exp.ifs import attractor

FULL_SIDE = 81  # pixels of such an image


@dataclass(frozen=True)
class Plot:
    """A plot of the points of a chaos game.

    kind: "dots" of one colour, "maps" with a colour for each map, "steps" coloured by their number through `colours`,
    "hexagons" and "image" for densities, "full" for an image of two colours up to the axes. beside: what stands in the
    plot beside the shape. format: of the file.
    """

    code: str
    kind: str
    beside: str
    style: str = "default"
    count: int = 20_000
    size: tuple[float, float] = (6.4, 4.8)
    colours: str = "viridis"
    format: str = "png"
    pen: str = "black"


SET = {
    "leaf of four colours": Plot("maple_leaf", "maps", "legend grid title", count=60_000, size=(7, 5)),
    "fern with minor ticks": Plot("fern", "dots", "grid minor labels title", pen="green"),
    "white on dark": Plot("sierpinski_triangle", "dots", "title grid labels", "dark_background", pen="white"),
    "dragon by its steps": Plot("heighway_dragon", "steps", "colour_bar title grid"),
    "hexagons on a dark panel": Plot("levy_c_curve", "hexagons", "colour_bar title labels", count=60_000),
    "density in inferno": Plot("spiral", "image", "colour_bar title", count=60_000, colours="inferno"),
    "density in grey on white": Plot("twindragon", "image", "colour_bar labels", count=60_000, colours="gray_r"),
    "two axes": Plot("tree", "dots", "second title", size=(9, 4), pen="brown"),
    "grey panel with white grid": Plot("terdragon", "dots", "grid legend title labels", "ggplot", pen="tab:blue"),
    "seaborn": Plot("koch_curve", "dots", "grid legend title labels", "seaborn-v0_8-darkgrid", pen="navy"),
    "grid without a frame": Plot("pentaflake", "dots", "grid title legend", "fivethirtyeight", pen="tab:red"),
    "note with an arrow": Plot("culcita", "dots", "note title", pen="green"),
    "two spines": Plot("hexaflake", "dots", "despined grid legend labels", pen="purple"),
    "yellow on navy": Plot("rauzy", "dots", "grid title labels legend", "navy", pen="gold"),
    "lines through the origin": Plot("vicsek", "dots", "origin title grid", pen="tab:blue"),
    "legend outside": Plot("gosper_island", "maps", "outside title grid"),
    "as a JPEG": Plot("cyclosorus", "dots", "legend grid title labels", pen="darkgreen", format="jpeg"),
    "squares and dashes": Plot("sierpinski_carpet", "dots", "dashed legend title", pen="black"),
    "bar without axes": Plot("koch_snowflake", "image", "colour_bar title bare", count=60_000, colours="magma"),
    "carpet that fills yellow axes": Plot("sierpinski_carpet", "full", "title"),
    "black carpet that fills its axes": Plot("sierpinski_carpet", "full", "title labels", colours="gray_r"),
    "carpet in inferno with its bar": Plot("sierpinski_carpet", "full", "colour_bar", colours="inferno"),
    "by Pillow": Plot("cantor_dust", "pillow", "", count=8000),
}


def draw(plot, plain=False):
    """The plot (H,W,3) uint8, or the file (BytesIO) of a JPEG; plain: with the shape alone, at the same place."""
    points, letters = points_of(plot)
    if plot.kind == "pillow":
        return by_pillow(points, plain)
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    navy = {"axes.facecolor": "#1b1f3b", "figure.facecolor": "#1b1f3b", "text.color": "w", "axes.edgecolor": "w",
            "xtick.color": "w", "ytick.color": "w", "axes.labelcolor": "w", "grid.alpha": .4}
    with plt.style.context(navy if plot.style == "navy" else plot.style):
        figure, axes = plt.subplots(1, 2 if "second" in plot.beside else 1, figsize=plot.size, dpi=100, squeeze=False)
        axis, inked = axes[0, 0], {"s": .6, "linewidths": 0}
        panel, shown = axis.get_facecolor(), None
        axis.set_aspect("equal", adjustable="box" if plot.kind in ("hexagons", "image", "full") else "datalim")
        if plot.kind == "dots":
            axis.scatter(*points.T, color=plot.pen, label="orbit", **inked)
        elif plot.kind == "maps":
            for letter in np.unique(letters):
                axis.scatter(*points[letters == letter].T, label=f"map {letter + 1}", **inked)
        elif plot.kind == "full":
            low, high = points.min(0), points.max(0)
            places = ((points - low) / (high - low) * FULL_SIDE).clip(0, FULL_SIDE - 1).astype(int)
            image = np.zeros((FULL_SIDE, FULL_SIDE))
            image[places[:, 1], places[:, 0]] = 1
            shown = axis.imshow(image, cmap=plot.colours, interpolation="nearest")
            panel = shown.cmap(0)
            if plain:
                axis.set(xlim=(-.1 * FULL_SIDE, 1.1 * FULL_SIDE), ylim=(-.1 * FULL_SIDE, 1.1 * FULL_SIDE))
        elif plot.kind == "steps":
            shown = axis.scatter(*points.T, c=np.arange(len(points)), cmap=plot.colours, **inked)
        else:
            margin = .08 * np.ptp(points, 0)
            (x0, y0), (x1, y1) = points.min(0) - margin, points.max(0) + margin
            if plot.kind == "hexagons":
                shown = axis.hexbin(*points.T, gridsize=150, extent=(x0, x1, y0, y1), cmap=plot.colours)
            else:
                counts = np.histogram2d(*points.T, 200, ((x0, x1), (y0, y1)))[0].T
                shown = axis.imshow(np.log1p(counts), origin="lower", cmap=plot.colours, extent=(x0, x1, y0, y1))
            panel = shown.cmap(0)
            axis.set(xlim=(x0, x1), ylim=(y0, y1))
        _furnish(plot, figure, axes, shown, points)
        if plain:
            for each in figure.axes[1:]:
                each.set_visible(False)
            axis.axis("off")
            for artist in (*axis.texts, *axis.lines, axis.title, axis.get_legend()):
                if artist is not None:
                    artist.set_visible(False)
            figure.set_facecolor(panel)
        file = io.BytesIO()
        figure.savefig(file, format=plot.format)
        plt.close(figure)
    return file if plot.format == "jpeg" else np.asarray(Image.open(file).convert("RGB"))


def points_of(plot):
    """The points (N,2) of the plot's code, and the number of the map that drew each of them (N,)."""
    points, letters = attractor.random_points(attractor.normalize(codes.known(plot.code)), plot.count)
    return np.asarray(points), np.asarray(letters)


def _furnish(plot, figure, axes, shown, points):
    """Add everything beside the shape."""
    axis, beside = axes[0, 0], plot.beside.split()
    if "second" in beside:
        axes[0, 1].scatter(*points[:700].T, s=.6, color=plot.pen, linewidths=0)
        axes[0, 1].set_aspect("equal", adjustable="datalim")
        axes[0, 1].set_title("700 points")
    if "grid" in beside or "dashed" in beside:
        axis.grid(True, **({"linestyle": "--"} if "dashed" in beside else {}))
    if "minor" in beside:
        axis.minorticks_on()
        axis.grid(True, which="minor", linewidth=.4, alpha=.4)
    if "legend" in beside:
        axis.legend(loc="upper right", markerscale=12)
    if "outside" in beside:
        axis.legend(loc="upper left", bbox_to_anchor=(1.02, 1), markerscale=12)
        figure.subplots_adjust(right=.78)
    if "title" in beside:
        axis.set_title(f"{plot.code.replace('_', ' ')}, {plot.count} points")
    if "labels" in beside:
        axis.set_xlabel("x")
        axis.set_ylabel("y")
    if "colour_bar" in beside:
        figure.colorbar(shown, ax=axis, label="step" if plot.kind == "steps" else "log density")
    if "despined" in beside:
        axis.spines[["top", "right"]].set_visible(False)
    if "origin" in beside:
        axis.axhline(0, color="black", linewidth=.8)
        axis.axvline(0, color="black", linewidth=.8)
    if "bare" in beside:
        axis.axis("off")
    if "note" in beside:
        axis.annotate("the tip", points[points[:, 1].argmax()], (.08, .85), textcoords="axes fraction",
                      arrowprops={"arrowstyle": "->"})


def by_pillow(points, plain):
    """Cyan points on a dark grid with two axes and their numbers."""
    from matplotlib import font_manager

    picture = Image.new("RGB", (600, 600), (12, 14, 40))
    pen, font = ImageDraw.Draw(picture), ImageFont.truetype(font_manager.findfont("DejaVu Sans"), 13)
    if not plain:
        for place in range(50, 600, 50):
            pen.line((place, 0, place, 599), (50, 54, 90))
            pen.line((0, place, 599, place), (50, 54, 90))
        pen.text((20, 570), "cantor dust, 8000 points", (230, 230, 230), font)
    for x, y in (300 + 260 * points * (1, -1)).round().astype(int):
        pen.point((x, y), (0, 230, 230))
    return np.asarray(picture)
