"""How the benchmarks' ratios went with time: a panel a benchmark, the ratios of its records against their dates.

    python -m benchmarks.history                     benchmarks/results/*.jsonl -> benchmarks/results/history.png

Ratios compare two things that ran side by side, or are scores, so that runs of different days can stand in one panel;
each machine has a marker of its own.
"""

from __future__ import annotations

import argparse
from datetime import datetime
from pathlib import Path

from . import record

MARKERS = "osD^v<>pX*"


def draw(records: dict[str, list[dict]], path: Path) -> Path:
    """The figure of records by benchmark, as a PNG; benchmarks without any ratio are left out."""
    from matplotlib.figure import Figure

    records = {name: lines for name, lines in records.items() if any(line["ratios"] for line in lines)}
    machines = sorted({each["machine"] for lines in records.values() for each in lines})
    marker = {machine: MARKERS[k % len(MARKERS)] for k, machine in enumerate(machines)}
    figure = Figure(figsize=(11, 2.8 * len(records)), layout="constrained")
    panels = figure.subplots(len(records), squeeze=False, sharex=True)[:, 0]
    for axes, (benchmark, lines) in zip(panels, records.items(), strict=True):
        for name in dict.fromkeys(name for line in lines for name in line["ratios"]):
            of_it = [line for line in lines if name in line["ratios"]]
            dates = [datetime.fromisoformat(line["date"]) for line in of_it]
            values = [line["ratios"][name] for line in of_it]
            [curve] = axes.plot(dates, values, linewidth=1, label=name)
            for date, value, line in zip(dates, values, of_it, strict=True):
                axes.plot(date, value, marker[line["machine"]], color=curve.get_color(), markersize=5)
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}")
        axes.set_title(benchmark, loc="left")
        axes.grid(alpha=0.3)
        axes.tick_params(which="both", labelsize=7)
        axes.legend(fontsize=6, loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    figure.supxlabel("machines: " + "; ".join(f"{marker[machine]} {machine}" for machine in machines), fontsize=7)
    figure.savefig(path, dpi=110)
    return path


def gather(folder: Path) -> dict[str, list[dict]]:
    """The records of all files of a folder by benchmark, oldest first."""
    found: dict[str, list[dict]] = {}
    for path in sorted(folder.glob("*.jsonl")):
        for each in record.read(path):
            found.setdefault(each["benchmark"], []).append(each)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=record.RESULTS, help="the folder of the records")
    parser.add_argument("--output", type=Path, help="default: history.png in that folder")
    arguments = parser.parse_args()
    records = gather(arguments.results)
    if not records:
        parser.error(f"there is no record in {arguments.results}")
    print(draw(records, arguments.output or arguments.results / "history.png"))


if __name__ == "__main__":
    main()
