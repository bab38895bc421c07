"""What unlike settings buy: ``python bench/asymmetry.py``, one batch of about a thousand tunings.

For n = 2 to 12 units, interactions over the whole range -1/(n - 1) < a < 1, three ratios of the
plant's time constant to the neglected dead time, PI and PID: splits of the units into groups of
like settings, beside identical settings. Goes through ``mutune batch``, so a run that was stopped
goes on where it was. Writes bench/asymmetry.csv, which docs/asymmetry.md reads.
"""

import csv
import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "bench" / "asymmetry.csv"
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
    for n in (2, 3, 6):  # a PID tuning takes two to four times as long
        yield from product(n, SHARES, "PID", sorted({(1, n - 1), (n // 2, n - n // 2)}))
    yield from product(4, SHARES[:3], "PI", [(1, 1, 1, 1)])


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
        "gain_percent": f"{compared['gain_percent']:.3f}" if compared else "",
        "k": settings("gain"), "tau_i": settings("integral_time"),
        "tau_d": settings("derivative_time"),
    }  # fmt: skip


def digits(value):
    """Return six digits; nothing where the demand cannot be met."""
    return f"{value:.6g}" if value else ""


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


if __name__ == "__main__":
    main()
