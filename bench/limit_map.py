"""Where single loops lose most: ``python -m bench.limit_map``, 240 s of one core.

The limit of all controllers over the interaction a, the time constant over the neglected dead time
theta, and n, beside what identical and grouped PI loops reach in bench/asymmetry.csv. A limit
of n = 1000 stands beside those of few units. Writes bench/limit_map.csv, a line as soon as it is
known, so that a run that was stopped goes on where it was, and the figure of docs/limits.md.
"""

import csv
import sys
import time
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from solver.limits.search import LimitSearch
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "bench" / "limit_map.csv"
LOOPS = ROOT / "bench" / "asymmetry.csv"
FIGURE = ROOT / "docs" / "images" / "limit_map.svg"
USUAL = Uncertainty.from_error(0.2, 1)  # theta is the unit of time
SHARES = (-0.95, -0.5, 0.0, 0.5, 0.8, 0.95)  # of the range of a, as in bench/asymmetry.py
RATIOS = (10, 30, 100)
SIZES = (2, 3, 12, 1000)
COLUMNS = ("n", "share", "a", "ratio", "identical", "grouped", "limit", "cpu_seconds")


def cases():
    """Yield n, share of the range of a, and tau over theta: all of n = 2 first."""
    for n in SIZES:
        for ratio in RATIOS if n == SIZES[0] else RATIOS[-1:]:
            for share in SHARES:
                yield n, share, ratio


def loops_at(n, share, ratio):
    """Return tau_P of identical PI loops and of the best two groups; empty where not computed."""
    with LOOPS.open() as file:
        lines = [
            line for line in csv.DictReader(file)
            if (line["n"], line["kind"], line["ratio"]) == (str(n), "PI", str(ratio))
            and float(line["share"]) == share
        ]  # fmt: skip
    identical = [float(line["identical"]) for line in lines if line["identical"]]
    grouped = [float(line["grouped"]) for line in lines if line["grouped"]]
    return min(identical, default=None), min(grouped, default=None)


def row(n, share, ratio):
    """Return one line of the table."""
    a = share if share > 0 else round(share / (n - 1), 6)
    plant = first_order(n, 1, ratio, a)
    started = time.process_time()
    found = LimitSearch(plant, USUAL, Performance()).run()
    took = time.process_time() - started
    identical, grouped = loops_at(n, share, ratio)
    return {
        "n": n, "share": share, "a": a, "ratio": ratio, "identical": identical or "",
        "grouped": grouped or "", "limit": f"{found.tau_p:.6g}" if found else "",
        "cpu_seconds": f"{took:.1f}",
    }  # fmt: skip


def draw(lines):
    """Draw tau_P of the loops over that of the limit, over a."""
    grey = "#808080"  # readable on white and on black
    style = dict.fromkeys(
        ("axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color", "text.color"), grey
    )
    style |= {"svg.hashsalt": "", "svg.fonttype": "none", "font.size": 9}
    series = (
        ("2", "100", "#0072B2", "o-"),
        ("2", "10", "#D55E00", "s:"),  # on the first one where the limits are the same
        ("12", "100", "#009E73", "^-"),
    )
    with mpl.rc_context(style):
        figure = Figure(figsize=(8, 3.2), layout="constrained")
        limit, lost = figure.subplots(1, 2)
        for n, ratio, color, form in series:
            own = [line for line in lines if (line["n"], line["ratio"]) == (n, ratio)]
            own.sort(key=lambda line: float(line["share"]))
            label = f"n = {n}, τ/θ = {ratio}"
            known = [line for line in own if line["limit"]]
            limit.plot([float(line["share"]) for line in known],
                       [float(line["limit"]) for line in known], form, color=color, ms=4,
                       label=label)  # fmt: skip
            both = [line for line in known if line["grouped"]]
            lost.plot([float(line["share"]) for line in both],
                      [float(line["grouped"]) / float(line["limit"]) for line in both], form,
                      color=color, ms=4, label=label)  # fmt: skip
        limit.set(xlabel="a as a share of its range", ylabel="limit of all controllers, τP/θ")
        lost.set(xlabel="a as a share of its range", ylabel="PI in two groups over the limit")
        for axes in (limit, lost):
            axes.legend(frameon=False)
            axes.set_xticks([-1, -0.5, 0, 0.5, 1])
            axes.patch.set_alpha(0)
        figure.savefig(FIGURE, transparent=True, metadata={"Date": None})


def main():
    """Fill the table, draw it."""
    known = []
    if TABLE.exists():
        with TABLE.open() as file:
            known = list(csv.DictReader(file))
    done = {(line["n"], line["share"], line["ratio"]) for line in known}
    with TABLE.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if not known:
            writer.writeheader()
        for n, share, ratio in cases():
            if (str(n), str(share), str(ratio)) in done:
                continue
            line = row(n, share, ratio)
            writer.writerow(line)
            file.flush()
            sys.stdout.write(" ".join(map(str, line.values())) + "\n")
    with TABLE.open() as file:
        draw(list(csv.DictReader(file)))


if __name__ == "__main__":
    main()
