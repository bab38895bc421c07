"""The command line: output, exit codes, messages."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from samples import ROBUSTNESS, TUNING, altered
from typer.testing import CliRunner, Result

from service.analyses.robustness import RobustnessResult
from service.cli.commands import app
from service.schemas import TuningResult
from solver.model.controllers import Controller
from solver.tuning import tuner
from solver.tuning.record import LocalOptimum, Progress, SearchSummary, Status, Tuning
from solver.tuning.specification import Specification

ROOT = Path(__file__).parent.parent.parent
# One start is enough to see the command work.
QUICK = altered(altered(TUNING, "/controller/arrangement", "identical"), "/search/starts", 1)


def mutune(*arguments: str, request: object = None) -> Result:
    """Run the command line in this process; `request` is its standard input, as JSON or text."""
    text = request if isinstance(request, str) else json.dumps(request)
    return CliRunner().invoke(app, list(arguments), input=text, catch_exceptions=False)


def outcome(specification: Specification, status: Status, **fields: Any) -> Tuning:
    """Return a tuning of this status, with the fields that matter to a test."""
    loops = (Controller(2.0, 5.0),) * specification.plant.n
    found: dict[str, Any] = {
        "tau_p": 20.0,
        "peaks": None,
        "loops": loops,
        "groups": (tuple(range(specification.plant.n)),),
        "nominally_stable": True,
        "curves": None,
        "search": SearchSummary(3, (LocalOptimum(20.0, 3, loops),), 0, 0.5),
    }
    return Tuning(status=status, objective="tau_p", **{**found, **fields})


def ending_as(monkeypatch: pytest.MonkeyPatch, status: Status, **fields: Any) -> None:
    """Make the tuner end this way."""

    def tune(specification: Specification, progress: object) -> Tuning:
        assert callable(progress)
        progress(Progress(0.5, 21.0, 1, 3))
        return outcome(specification, status, **fields)

    monkeypatch.setattr(tuner, "tune", tune)


def test_tune_prints_the_json_result_alone() -> None:
    """With --json standard output is the documented result, and standard error is empty."""
    result = mutune("tune", "-", "--json", request=QUICK)
    assert result.exit_code == 0
    assert result.stderr == ""
    tuning = TuningResult.model_validate_json(result.stdout)
    assert tuning.status == "optimal"
    assert len(result.stdout.splitlines()) == 1


def test_tune_says_right_after_the_outcome_how_wrong_the_model_may_be() -> None:
    """Published plant: 1.1 % more interaction than thought costs the demand."""
    request = altered(TUNING, "/search/starts", 1)
    result = mutune("tune", "-", "--json", request=request)
    found = {each["parameter"]: each for each in json.loads(result.stdout)["model_tolerance"]}
    assert set(found) == {"gain", "time_constant", "interaction"}
    assert found["interaction"]["demand"][1] == pytest.approx(0.011, rel=0.1)
    headline, second = mutune("tune", "-", request=request).stdout.splitlines()[:2]
    assert headline.startswith("Optimal")
    assert second.startswith("The model may be wrong, one parameter alone, by: interaction: demand")


def test_tune_prints_the_settings_in_three_forms(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tables show cascade, ideal and parallel settings of each group, loops counted from 1."""
    loops = (Controller(2.0, 5.0, 1.0), Controller(2.0, 5.0, 1.0), Controller(3.0, 4.0, 1.0))
    ending_as(monkeypatch, Status.OPTIMAL, loops=loops, groups=((0, 1), (2,)))
    output = mutune("tune", "-", request=altered(TUNING, "/plant/n", 3)).stdout
    assert "τP = 20" in output
    rows = [line.split() for line in output.splitlines() if line.strip().startswith(("1-2", "3 "))]
    assert rows[:2] == [["1-2", "2", "5", "1", "0.1"], ["3", "3", "4", "1", "0.1"]]
    # K = 2 (5 + 0.9)/5, T_i = 5.9, T_d = 5/5.9 - 0.1, T_f = 0.1
    assert rows[2] == ["1-2", "2.36", "5.9", "0.74746", "0.1"]
    # K_p = K, K_i = K/T_i, K_d = K T_d
    assert rows[4] == ["1-2", "2.36", "0.4", "1.764", "0.1"]
    assert "20 (3x)" in output


def test_form_that_does_not_exist_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings without an ideal form say so in place of numbers."""
    ending_as(monkeypatch, Status.OPTIMAL, loops=(Controller(1.0, 0.05, 1.0),) * 2)
    output = mutune("tune", "-", request=TUNING).stdout
    assert "no ideal form" in " ".join(output.split())


def test_warnings_are_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the tuner warns of reaches the reader."""
    ending_as(monkeypatch, Status.OPTIMAL, warnings=("the gain of loop 1 sits on its bound",))
    assert "Warning: the gain of loop 1" in mutune("tune", "-", request=TUNING).stdout


def test_infeasible_request_exits_with_3(monkeypatch: pytest.MonkeyPatch) -> None:
    """The reason and the frequency that forbids it are printed."""
    ending_as(
        monkeypatch, Status.INFEASIBLE, tau_p=None, loops=(), reason="too uncertain", omega=1.5
    )
    result = mutune("tune", "-", request=TUNING)
    assert result.exit_code == 3
    assert "Infeasible: too uncertain (at 1.5 rad per time unit)" in result.stdout


@pytest.mark.parametrize(
    ("fields", "words"),
    [({}, "the best so far"), ({"loops": (), "groups": (), "tau_p": None}, "nothing found yet")],
)
def test_time_limit_exits_with_4(
    monkeypatch: pytest.MonkeyPatch, fields: dict[str, Any], words: str
) -> None:
    """A search cut short says whether it has found anything."""
    ending_as(monkeypatch, Status.TIME_LIMIT, **fields)
    result = mutune("tune", "-", request=TUNING)
    assert result.exit_code == 4
    assert words in result.stdout


def test_interrupted_tuning_exits_with_130(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C ends with one line and no traceback."""

    def tune(_specification: object, _progress: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(tuner, "tune", tune)
    result = mutune("tune", "-", request=TUNING)
    assert (result.exit_code, result.stdout, result.stderr) == (130, "", "Interrupted.\n")


def test_fault_of_the_solver_is_one_line_to_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """What nobody foresaw exits with 1 and says what and where, without a traceback."""

    def tune(_specification: object, _progress: object) -> None:
        message = "the matrix is singular"
        raise ArithmeticError(message)

    monkeypatch.setattr(tuner, "tune", tune)
    result = mutune("tune", "-", request=TUNING)
    assert result.exit_code == 1
    assert re.fullmatch(
        r"error: .* ArithmeticError: the matrix is singular \(test_cli.py:\d+\); .*\n",
        result.stderr,
    )


@pytest.mark.parametrize(
    ("request_", "pointer"),
    [
        (altered(TUNING, "/plant/n", 0), "/plant/n"),
        (altered(TUNING, "/plant/n", 10**6), "/plant/n"),
        (altered(TUNING, "/plant/time_constant", "long"), "/plant/time_constant"),
        (altered(TUNING, "/plant/kind", "round"), "/plant/kind"),
        (altered(TUNING, "/objective", "beauty"), "/objective"),
        (altered(TUNING, "/objective", "mu"), "/performance/tau_p"),
        (altered(TUNING, "/controller/group_sizes", [1, 1]), "/controller/group_sizes"),
        (altered(TUNING, "/unknown", 1), "/unknown"),
        ({"plant": TUNING["plant"]}, "/uncertainty"),
    ],
)
def test_faulty_request_exits_with_2_and_names_the_field(request_: object, pointer: str) -> None:
    """One line on standard error, by JSON pointer; nothing on standard output."""
    result = mutune("tune", "-", "--json", request=request_)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"error: {pointer}: ")
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"plant": NaN}', "\x00", "[" * 5000])
def test_what_is_no_request_exits_with_2(text: str) -> None:
    """Anything but a JSON object is refused."""
    result = mutune("tune", "-", request=text)
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")


@pytest.mark.parametrize("command", ["tune", "robustness", "batch"])
def test_file_that_is_not_there_is_named(command: str, tmp_path: Path) -> None:
    """The path is in the message."""
    result = mutune(command, str(tmp_path / "absent.json"))
    assert result.exit_code == 2
    assert result.stderr == f"error: {tmp_path}/absent.json: No such file or directory\n"


def test_robustness_prints_the_json_result_alone() -> None:
    """The published settings peak at mu = 1.0003484 (SLH section 5.3, tau_P = 19)."""
    result = mutune("robustness", "-", "--json", request=ROBUSTNESS)
    assert result.exit_code == 0
    analysis = RobustnessResult.model_validate_json(result.stdout)
    assert analysis.peaks is not None
    assert analysis.peaks.robust_performance.value == pytest.approx(1.00034840, abs=1e-7)


def test_robustness_prints_peaks_margins_and_proof() -> None:
    """The tables show stability, peaks, the margins of each loop, and what is proven."""
    output = mutune("robustness", "-", request=ROBUSTNESS).stdout
    assert "Nominally stable, demand not met: mu reaches 1.0003, above 1." in output
    assert "at most 1: demand met" not in output
    assert re.search(r"robust performance +1\.0003 +0\.031436", output)
    assert re.search(r"loop 2 +open +- +47\.07", output)
    proven = re.search(r"at most ([\d.]+) at\s+every frequency", output)
    assert proven is not None
    assert 1.0003484 <= float(proven[1]) < 1.001


def test_unstable_loops_are_called_unstable() -> None:
    """Without nominal stability there are no peaks to show."""
    request = altered(ROBUSTNESS, "/plant/dead_time", 10)
    output = mutune("robustness", "-", request=request).stdout
    assert re.match(r"Unstable: \d+ closed-loop pole", output)
    assert "robust performance" not in output


def test_robustness_needs_as_many_loops_as_units() -> None:
    """A fault that the schema cannot express is named by pointer as well."""
    result = mutune("robustness", "-", request=altered(ROBUSTNESS, "/plant/n", 3))
    assert result.exit_code == 2
    assert result.stderr.startswith("error: /loops: ")


def test_worker_needs_a_scheduler() -> None:
    """A worker without an address is told how to give one."""
    result = mutune("worker")
    assert result.exit_code == 2
    assert "MUTUNE_SCHEDULER" in result.stderr


def test_version_is_printed() -> None:
    """The version stands alone on a line."""
    assert re.fullmatch(r"mutune \d+\.\d+\.\d+\n", mutune("--version").stdout)


def test_help_imports_nothing_heavy() -> None:
    """Help must be there at once: the numerical libraries wait for a command."""
    script = (
        "import sys, service.cli; "
        "print([m for m in ('numpy', 'numba', 'pydantic', 'rich', 'distributed', 'fastapi') "
        "if m in sys.modules])"
    )
    done = subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout == "[]\n"


def test_every_command_has_help() -> None:
    """Each command explains itself and its options."""
    listed = re.findall(r"^  (\w+)  +[A-Z]", mutune("--help").stdout, re.MULTILINE)
    assert {"tune", "batch", "robustness", "serve", "worker"} <= set(listed)
    for command in listed:
        assert "Usage: " in mutune(command, "--help").stdout


def test_tune_proves_how_far_from_the_best_where_asked() -> None:
    """`--optimality-gap` adds the proof to what the request asks, in words and in the JSON."""
    printed = mutune("tune", "-", "--optimality-gap", request=QUICK).output
    assert "Proven: no settings in such groups" in " ".join(printed.split())
    document = json.loads(mutune("tune", "-", "--optimality-gap", "--json", request=QUICK).stdout)
    proof = document["optimality"]
    assert proof["status"] == "reached"
    assert 0.99 * document["tau_p"] < proof["lower_bound"] < document["tau_p"]
    assert json.loads(mutune("tune", "-", "--json", request=QUICK).stdout)["optimality"] is None


def test_a_proof_that_does_not_exist_is_refused_by_name() -> None:
    """PIDF has no proof of optimality: exit code 2, and the field."""
    free = altered(altered(QUICK, "/controller/kind", "PIDF"), "/search/optimality_gap", True)
    result = mutune("tune", "-", request=free)
    assert result.exit_code == 2
    assert "/search/optimality_gap: the optimality gap is proven for PI and PID" in result.stderr


def test_an_unstable_loop_is_said_to_be_so_first() -> None:
    """The first line says it, and how far the gains must come down."""
    loops = [{"gain": 4000.0, "integral_time": 101.0}, {"gain": 22.8, "integral_time": 3.15}]
    plant = {**ROBUSTNESS["plant"], "dead_time": 1.0}
    request = {**ROBUSTNESS, "plant": plant, "loops": loops}
    output = mutune("robustness", "-", request=request).stdout
    assert output.lstrip().startswith("Unstable:")
    assert re.search(r"Stable with all gains reduced to [\d.e-]+ times", output)
