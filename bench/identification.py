"""The figure of README and docs/identification.md: from a record to settings on a bench.

    python -m bench.identification

Runs the three commands of the README and draws the record kept back with what the plant makes of
it, the errors below their weight, and the loops on the nonlinear bench (matplotlib comes with the
extra `test`).
"""

import json
import runpy
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
FIGURE = ROOT / "docs" / "images" / "two_heaters.svg"
COLUMNS = ("--time", "Time", "--inputs", "Heater 1,Heater 2",
           "--outputs", "Temperature 1,Temperature 2")  # fmt: skip
COLORS = ("#0072B2", "#D55E00", "#009E73")
THIN = 8  # of the bench's seconds, one in so many is drawn


def mutune(*arguments):
    """Return what a command prints."""
    command = [sys.executable, "-c", "from service.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def work():
    """Return the identification, and the trace on the bench of the settings tuned for it."""
    steps, kept = (ROOT / "examples" / f"two_heaters_{name}.csv" for name in ("steps", "random"))
    bench = runpy.run_path(str(ROOT / "examples" / "bench" / "two_heaters.py"))
    with tempfile.TemporaryDirectory() as folder:
        request = Path(folder) / "heaters.json"
        found = mutune("identify", steps, *COLUMNS, "--validate", kept, "-o", request, "--json")
        tuned = json.loads(mutune("tune", request, "--json"))
    print(f"tau_P = {tuned['tau_p']:.5g} s, guarantee {tuned['guarantee']['status']}")
    loops = [bench["Pi"](loop["gain"], loop["integral_time"]) for loop in tuned["loops"]]
    return json.loads(found), bench["run"](loops)


def main():
    """Draw."""
    found, trace = work()
    grey = "#808080"  # readable on white and on black
    style = dict.fromkeys(
        ("axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color", "text.color"), grey
    )
    style |= {"svg.hashsalt": "", "svg.fonttype": "none", "font.size": 9}
    with mpl.rc_context(style):
        figure = Figure(figsize=(9, 3.2), layout="constrained")
        record, errors, closed = figure.subplots(1, 3)
        kept = [one for one in found["predictions"] if one["kept_back"]]
        for color, one in zip(COLORS, kept, strict=False):
            record.plot(one["time"], one["measured"], ".", color=color, ms=2)
            label = f"{one['output']}, fit {one['normalised_fit']:.0f} %"
            record.plot(one["time"], one["predicted"], color, lw=1, label=label)
        record.set(title="record kept back, and the plant", xlabel="time (s)", ylabel="°C")
        errors.loglog(found["omega"], found["weight_magnitude"], COLORS[0], label="weight")
        for color, curve in zip(COLORS[1:], found["errors"], strict=False):
            errors.loglog(found["omega"], curve["size"], color, lw=1, label=curve["source"])
        errors.set(title="errors of the plant", xlabel="frequency (rad/s)")
        for index, color in enumerate(COLORS[:2]):
            closed.plot(
                [t for t, _, _ in trace[::THIN]], [y[index] for _, y, _ in trace[::THIN]],
                color, lw=1, label=f"Temperature {index + 1}",
            )  # fmt: skip
        closed.set(title="the settings on a nonlinear bench", xlabel="time (s)", ylabel="°C")
        for axes in (record, errors, closed):
            axes.legend(frameon=False)
            axes.patch.set_alpha(0)
        figure.savefig(FIGURE, transparent=True, metadata={"Date": None})


if __name__ == "__main__":
    main()
