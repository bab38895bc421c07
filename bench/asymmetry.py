"""What unlike settings buy: ``python bench/asymmetry.py``, one batch of about a thousand tunings.

For n = 2 to 12 units, interactions over the whole range -1/(n - 1) < a < 1, three ratios of the
plant's time constant to the neglected dead time, PI and PID: every split into two groups, beside
identical settings. Goes through ``mutune batch``, so a run that was stopped goes on where it was.
Writes bench/asymmetry.csv.
"""

import csv
import json
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
SHARES = (-0.95, -0.8, -0.5, 0.5, 0.8, 0.95)  # of the range of a that integral action permits
SIZES = range(2, 13)
RATIOS = (10, 30, 100)  # time constant over theta
KINDS = {"PI": 10, "PID": 6}  # and the largest n for it: a PID tuning takes four times as long
COLUMNS = ("n", "a", "ratio", "kind", "first_group", "identical", "grouped", "gain_percent")


def cases():
    """Yield n, a, ratio, kind and the size of the first group."""
    for kind, largest in KINDS.items():
        for n in SIZES:
            if n > largest and n != SIZES[-1]:
                continue
            for share in SHARES:
                a = share if share > 0 else share / (n - 1)
                for ratio in RATIOS:
                    for first in range(1, n // 2 + 1):
                        yield n, round(a, 6), ratio, kind, first


def request(n, a, ratio, kind, first):
    """Return the request of one case."""
    return {
        "plant": {"kind": "first_order", "n": n, "gain": 1, "time_constant": ratio,
                  "interaction": a},
        "uncertainty": {"epsilon": 0.2, "theta": 1},
        "performance": {"max_peak": 2},
        "controller": {"kind": kind, "arrangement": "grouped", "group_sizes": [first, n - first]},
        "certificate": "none",
    }  # fmt: skip


def row(case, result):
    """One line of the table: both time constants and what asymmetry gains."""
    grouped, compared = result["tau_p"], result["comparison"]
    identical = compared["identical_value"] if compared else None
    gain = 100 * (1 - grouped / identical) if grouped and identical else None
    return dict(zip(COLUMNS, (*case, identical, grouped, gain), strict=True))


def main():
    """Run the batch, write the table."""
    requests, results = FOLDER / "asymmetry.ndjson", FOLDER / "asymmetry_results.ndjson"
    tasks = list(cases())
    requests.write_text("".join(json.dumps(request(*case)) + "\n" for case in tasks))
    command = [Path(sys.executable).with_name("mutune"), "batch", requests, "-o", results]
    subprocess.run(command, check=False)  # exits with 3 where some case is infeasible
    rows = []
    with results.open() as lines:
        for line in lines:
            item = json.loads(line)
            rows.append(row(tasks[item["index"]], item["result"]))
    with (FOLDER / "asymmetry.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in r.items()} for r in rows
        )


if __name__ == "__main__":
    main()
