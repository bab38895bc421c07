"""What unlike settings buy: ``python -m bench.asymmetry``, one batch of 810 tunings.

For n = 2 to 12 units, interactions over the whole range -1/(n - 1) < a < 1, three ratios of the
plant's time constant to the neglected dead time, PI and PID: splits of the units into groups of
like settings, beside identical settings. Goes through ``mutune batch``, so a run that was stopped
goes on where it was. Writes bench/asymmetry.csv and the figure of docs/asymmetry.md (matplotlib
comes with the peers that the tests use).
"""

import csv
import json
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "bench" / "asymmetry.csv"
FIGURE = ROOT / "docs" / "images" / "asymmetry.svg"
WORK = ROOT / "build" / "asymmetry"

# Of the range of a that integral action permits: a = share where positive, else share / (n - 1).
SHARES = (-0.95, -0.8, -0.5, 0.5, 0.8, 0.95)
BETWEEN = (-0.98, -0.9, -0.65, -0.2, 0.2, 0.65, 0.9, 0.98)
RATIOS = (10, 30, 100)  # time constant over theta
COLUMNS = (
    "n", "share", "a", "ratio", "kind", "groups", "identical", "grouped", "gain_percent",
    "k", "tau_i", "tau_d",
)  # fmt: skip


def cases():
    """Yield n, share of the range of a, ratio, kind and group sizes: the broadest part first."""
    for n in range(2, 13):
        yield from product(n, SHARES, "PI", splits(n))
    for n in (2, 3, 4):
        yield from product(n, BETWEEN, "PI", splits(n))
    yield from product(3, SHARES, "PI", [(1, 1, 1)])  # are two groups enough?
    # A PID tuning takes two to four times as long.
    for n, shares in ((2, SHARES), (3, SHARES), (6, SHARES[:2])):
        yield from product(n, shares, "PID", sorted({(1, n - 1), (n // 2, n - n // 2)}))


def splits(n):
    """Return the sizes of every split into two groups."""
    return [(first, n - first) for first in range(1, n // 2 + 1)]


def product(n, shares, kind, groupings):
    """Yield the cases of one n and kind."""
    for share in shares:
        for ratio in RATIOS:
            for groups in groupings:
                yield n, share, ratio, kind, groups


def interaction(n, share):
    """Return a."""
    return share if share > 0 else round(share / (n - 1), 6)


def request(n, share, ratio, kind, groups):
    """Return the request of one case; the dead time is the unit of time."""
    return {
        "plant": {"kind": "first_order", "n": n, "gain": 1, "time_constant": ratio,
                  "interaction": interaction(n, share)},
        "uncertainty": {"epsilon": 0.2, "theta": 1},
        "performance": {"max_peak": 2},
        "controller": {"kind": kind, "arrangement": "grouped", "group_sizes": groups},
        "search": {"time_limit": 3600},
    }  # fmt: skip


def row(case, result):
    """Return one line of the table: both time constants, what asymmetry gains, the settings."""
    n, share, ratio, kind, groups = case
    compared = result["comparison"]
    loops = [result["loops"][group[0]] for group in result["groups"]] if compared else []

    def settings(name):
        return " ".join(f"{loop[name]:.5g}" for loop in loops if loop[name] is not None)

    return {
        "n": n, "share": share, "a": interaction(n, share), "ratio": ratio, "kind": kind,
        "groups": "+".join(map(str, groups)),
        "identical": digits(compared and compared["identical_value"]),
        "grouped": digits(result["tau_p"]),
        "gain_percent": f"{round(compared['gain_percent'], 3) + 0:.3f}" if compared else "",
        "k": settings("gain"), "tau_i": settings("integral_time"),
        "tau_d": settings("derivative_time"),
    }  # fmt: skip


def digits(value):
    """Return six digits; nothing where the demand cannot be met."""
    return f"{value:.6g}" if value else ""


def draw(lines):
    """Draw what the best split of n units buys over a, and each split of twelve."""
    grey = "#808080"  # readable on white and on black
    style = dict.fromkeys(
        ("axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color", "text.color"), grey
    )
    style |= {"svg.hashsalt": "", "svg.fonttype": "none", "font.size": 9}
    with mpl.rc_context(style):
        figure = Figure(figsize=(8, 3.4), layout="constrained")
        over_a, over_split = figure.subplots(1, 2, sharey=True)
        for n, color, marker in ((2, "#0072B2", "o"), (4, "#D55E00", "s"), (12, "#009E73", "^")):
            best = {}
            for line in lines:
                if (line["n"], line["kind"], line["ratio"]) == (str(n), "PI", "100"):
                    share = float(line["share"])
                    best[share] = max(best.get(share, 0.0), float(line["gain_percent"]))
            over_a.plot(*zip(*sorted(best.items()), strict=True), color, marker=marker, ms=4,
                        label=f"n = {n}")  # fmt: skip
        shares = (("-0.95", "#0072B2", "o"), ("-0.8", "#D55E00", "s"), ("-0.5", "#009E73", "^"))
        for share, color, marker in shares:
            gains = [
                float(line["gain_percent"]) for line in lines
                if (line["n"], line["kind"], line["ratio"], line["share"])
                == ("12", "PI", "100", share)
            ]  # fmt: skip
            over_split.plot(range(1, 7), gains, color, marker=marker, ms=4, label=f"share {share}")
        over_a.set(xlabel="a as a share of its range, -1/(n - 1) to 1",
                   ylabel="reduction of τP by the best split (%)",
                   xticks=(-1, -0.5, 0, 0.5, 1))  # fmt: skip
        over_split.set(xlabel="units in the smaller group, of 12",
                       ylabel="reduction of τP by this split (%)")  # fmt: skip
        for axes in (over_a, over_split):
            axes.legend(frameon=False)
            axes.patch.set_alpha(0)
            axes.tick_params(labelleft=True)
        figure.savefig(FIGURE, transparent=True, metadata={"Date": None})


def main():
    """Run the batch, write the table."""
    WORK.mkdir(parents=True, exist_ok=True)
    requests, results = WORK / "requests.ndjson", WORK / "results.ndjson"
    tasks = list(cases())
    requests.write_text("".join(json.dumps(request(*case)) + "\n" for case in tasks))
    command = [Path(sys.executable).with_name("mutune"), "batch", requests, "-o", results]
    subprocess.run(command, check=True)
    with results.open() as lines, TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for case, line in zip(tasks, lines, strict=True):
            writer.writerow(row(case, json.loads(line)["result"]))
    with TABLE.open() as file:
        draw([line for line in csv.DictReader(file) if line["groups"].count("+") == 1])


if __name__ == "__main__":
    main()
