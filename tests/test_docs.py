"""The pages do what they say: commands run, numbers are those printed, examples work."""

from __future__ import annotations

import ast
import contextlib
import io
import json
import re
import shlex
import shutil
from pathlib import Path

import documentation
import pytest
from typer.testing import CliRunner

import mutune
from service import registry
from service.cli.commands import app
from service.schemas import TuningRequest
from service.schemas.parsing import parse

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"
# The command of an example by the first words of its name; all others are tunings.
COMMANDS = {
    "controller_forms": "controller-forms",
    "decoupling": "decouple",
    "integrity": "integrity",
    "interaction": "interaction",
    "loop_responses": "loop-responses",
    "parallel_drives": "parallel-drives",
    "physical": "physical",
    "relay_tuning": "relay-tuning",
    "relay": "relay",
    "retune": "retune",
    "robustness": "robustness",
    "step_response": "step-response",
}
REQUESTS = sorted(path.name for path in EXAMPLES.glob("*.json"))


def command_of(name: str) -> str:
    """Return the command that an example is for."""
    found = [command for start, command in COMMANDS.items() if name.startswith(start)]
    return found[0] if found else "tune"


@pytest.mark.parametrize(
    "page", documentation.pages(), ids=lambda page: str(page.relative_to(ROOT))
)
def test_blocks_print_what_the_page_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every block marked to be run works, and prints the lines shown behind it."""
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    for block in documentation.runs(page):
        if block.mark.startswith("file: "):
            Path(block.mark.removeprefix("file: ")).write_text(block.text, encoding="utf-8")
            continue
        if block.language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as stream:
                exec(compile(block.text, str(page), "exec"), names)  # noqa: S102 - our own pages
            output = stream.getvalue()
        else:
            output = "".join(_printed(line) for line in _commands(block.text))
        assert documentation.missing_line(block.printed, output) is None, output


def _commands(text: str) -> list[str]:
    return [line for line in text.replace("\\\n", " ").splitlines() if line.strip()]


def _printed(line: str) -> str:
    program, *arguments = shlex.split(line, comments=True)
    assert program == "mutune", line
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.parametrize("name", REQUESTS)
def test_every_example_runs(name: str) -> None:
    """Each example is done by its command; tunings, which take long, are only read."""
    command = command_of(name)
    text = (EXAMPLES / name).read_text(encoding="utf-8")
    if command == "tune":
        parse(TuningRequest, text).build()
        return
    result = CliRunner().invoke(app, [command, str(EXAMPLES / name), "--json"])
    assert result.exit_code == 0, result.output
    json.loads(result.stdout)


def test_table_of_costs() -> None:
    """The time constants over epsilon, theta and max_peak are those that a search finds."""
    page = (ROOT / "docs" / "howto" / "choose_uncertainty.md").read_text(encoding="utf-8")
    table = re.findall(
        r"^\| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", page, re.MULTILINE
    )
    assert len(table) == 9
    plant = mutune.first_order(2, gain=1, time_constant=100, interaction=0.949)
    known = {
        "identical": [mutune.Controller(39.52, 57.5)] * 2,
        "independent": [mutune.Controller(47.655, 101.23), mutune.Controller(18.901, 2.361)],
    }
    for row in table:
        epsilon, theta, peak, *said = map(float, row)
        uncertainty = mutune.Uncertainty.from_error(epsilon, theta)
        found = [
            mutune.tune(
                plant, uncertainty, max_peak=peak, arrangement=arrangement, start=start
            ).tau_p
            for arrangement, start in known.items()
        ]
        assert said == pytest.approx(found, abs=6e-3), row


def test_python_reference_has_every_name() -> None:
    """All that `mutune` exports stands in the reference, and nothing else."""
    page = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    listed = " ".join(re.findall(r"<!-- python: ([\w\s]+) -->", page)).split()
    assert sorted(listed) == sorted(set(mutune.__all__) - {"__version__"})


def test_listed_messages_are_those_of_the_program() -> None:
    """Each message in the reference of warnings is written somewhere in the program."""
    page = (ROOT / "docs" / "reference" / "warnings.md").read_text(encoding="utf-8")
    written = "\n".join(_texts())
    rows = re.findall(r"^\| (.+?) \|", page, re.MULTILINE)
    listed = [quoted for row in rows for quoted in _QUOTED(row)]
    parts = [
        part.strip(" ,;:%()") for each in listed for part in re.split(r"\.\.\.?|\d[\d.]*", each)
    ]
    phrases = [part for part in parts if len(part.split()) > _WORDS_OF_A_PHRASE]
    assert len(phrases) > len(listed) / 2
    assert [phrase for phrase in phrases if phrase not in written] == []


_QUOTED = re.compile(r"`(?:/[\w/]+: )?([^`]+)`").findall
_WORDS_OF_A_PHRASE = 2


def _texts() -> list[str]:
    """Return the texts written in the program, without what is put into them."""
    return [
        node.value
        for path in (*ROOT.glob("solver/**/*.py"), *ROOT.glob("service/**/*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]


def test_every_command_has_an_example() -> None:
    """Each command that takes one request has a file to start from."""
    assert {command_of(name) for name in REQUESTS} == {*COMMANDS.values(), "tune"}


def test_every_analysis_has_a_section() -> None:
    """The reference of commands has a heading and a route for each."""
    text = (ROOT / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
    for module in registry.names():
        assert f"\n## {module.replace('_', '-')}\n" in text
    for analysis in registry.every():
        assert f"`POST {analysis.path}`" in text


def test_every_example_is_on_a_page() -> None:
    """Each example file is named where a reader finds it."""
    pages = [ROOT / "README.md", *ROOT.glob("docs/**/*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    for path in filter(Path.is_file, EXAMPLES.iterdir()):
        assert f"examples/{path.name}" in text, path.name


def test_a_changed_number_is_seen() -> None:
    """The comparison lets last digits pass, and nothing else."""
    line = ("mu is 1.5597",)
    assert documentation.missing_line(line, "mu is 1.5598\n") is None
    assert documentation.missing_line(line, "mu is 1.5601\n") == line[0]
    assert documentation.missing_line(line, "mu was 1.5597\n") == line[0]
    assert documentation.missing_line(("4 sets",), "5 sets\n") == "4 sets"
