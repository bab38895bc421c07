"""What the README says is so: its numbers, its calls, its links."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from readme import README, blocks, rows
from touring import ROOT

from service.analyses.robustness import RobustnessRequest
from service.cli.commands import app
from service.client import Client
from service.schemas import TuningRequest, TuningResult
from service.schemas.controllers import ControllerChoice
from service.schemas.parsing import parse
from service.schemas.tunings import Search

DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


def test_sentence_on_the_gain_agrees_with_the_table() -> None:
    """The gain is quoted as the table has it."""
    identical, independent = rows(blocks("")[0])["closed-loop time constant τP"]
    sentence = re.search(r"from ([\d.]+) to ([\d.]+) min, by (\d+) %", README)
    assert sentence is not None
    assert [float(value) for value in sentence.groups()] == [
        round(identical, 1),
        round(independent, 1),
        round(100 * (1 - independent / identical)),
    ]


def test_commands_exist() -> None:
    """Every command line in the README is one that mutune knows, on files that are there."""
    (calls,) = (block for block in blocks("sh") if block.startswith("mutune"))
    for line in calls.splitlines():
        program, command, *arguments = line.split("#")[0].split()
        help_text = subprocess.run(  # noqa: S603 - our own program
            [Path(sys.executable).with_name(program), command, "--help"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for argument in arguments:
            if argument.startswith("-"):
                assert argument in help_text
            if argument.startswith("examples/"):
                assert (ROOT / argument).exists()


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path: Path) -> None:
    """Relative links point to files and headings that exist."""
    for target in re.findall(r"\]\((?!https?://)([^)]+)\)", path.read_text()):
        name, _, heading = target.partition("#")
        file = path.parent / name if name else path
        assert file.exists(), target
        if heading:
            titles = re.findall(r"^#+ (.+)$", file.read_text(), re.MULTILINE)
            anchors = [re.sub(r"[^\w\- ]", "", each.lower()).replace(" ", "-") for each in titles]
            assert heading in anchors, target


def test_api_guide_lists_every_operation() -> None:
    """docs/api.md and the OpenAPI document name the same operations."""
    document = json.loads((ROOT / "openapi" / "openapi.json").read_text())
    operations = {
        f"{method.upper()} {path}" for path, item in document["paths"].items() for method in item
    }
    guide = (ROOT / "docs" / "api.md").read_text()
    assert set(re.findall(r"`((?:GET|POST|DELETE) /\S+)`", guide)) == operations


def test_api_guide_lists_every_command() -> None:
    """docs/api.md and the command line name the same commands."""
    guide = (ROOT / "docs" / "api.md").read_text()
    commands = {each.name or each.callback.__name__ for each in app.registered_commands}
    groups = {each.name for each in app.registered_groups}
    assert set(re.findall(r"^\| `mutune ([\w-]+)", guide, re.MULTILINE)) == commands | groups


def test_api_guide_lists_every_method_of_the_client() -> None:
    """docs/api.md names what the Python client can do."""
    guide = (ROOT / "docs" / "api.md").read_text().split("\n## Python")[1].split("\n## ")[0]
    methods = {name for name in vars(Client) if not name.startswith("_")} - {"close"}
    assert methods <= set(re.findall(r"`(\w+)[`(]", guide))


def test_api_guide_names_every_field_of_a_tuning() -> None:
    """No field of a request or of a result is left out."""
    guide = (ROOT / "docs" / "api.md").read_text()
    for model in (TuningRequest, Search, ControllerChoice, TuningResult):
        for name in model.model_fields:
            assert re.search(rf"\b{name}\b", guide), name


def test_requests_in_the_api_guide_are_valid() -> None:
    """Every request shown can be sent as it stands."""
    guide = (ROOT / "docs" / "api.md").read_text()
    texts = re.findall(r"^```json\n(.*?)^```$", guide, re.MULTILINE | re.DOTALL)
    requests = [text for text in texts if '"plant"' in text.split("\n")[1]]
    assert len(requests) == 3
    for text in requests:
        model = RobustnessRequest if '"loops"' in text else TuningRequest
        parse(model, text).build()


@pytest.mark.parametrize("name", ["parallel_reactors", "stream_split", "distillation_column"])
def test_examples_of_tunings_are_valid(name: str) -> None:
    """The tunings among the examples can be sent as they stand."""
    parse(TuningRequest, (ROOT / "examples" / f"{name}.json").read_text()).build()
