"""The registry of analyses: what one file more brings, and what every analysis has."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from service import registry
from service.client import Client

ROOT = Path(__file__).parents[2]

TOY = '''"""Double a number.

Return twice the number of the request.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from service.analysis import Analysis, Figures
from service.printing import Line, Part
from service.schemas.drawn import Drawn
from service.schemas.fields import AnalysisRequest, ResultModel
from solver.model.errors import InvalidInputError


class ToyRequest(AnalysisRequest):
    """Ask for twice a number."""

    number: float = Field(description="A number.", examples=[1.5])

    def build(self) -> float:
        """Return the number."""
        if self.number < 0:
            message = "negative numbers are not doubled"
            raise InvalidInputError(message, "/number")
        return self.number


class ToyResult(ResultModel):
    """Twice a number."""

    doubled: float = Field(description="Twice the number.", examples=[3.0])


class DrawnToy(Drawn):
    """What is drawn of it."""

    doubled: float = Field(description="Twice the number.", examples=[3.0])


def compute(request: ToyRequest) -> dict[str, Any]:
    return {"doubled": 2 * request.build()}


def table(result: ToyResult) -> list[Part]:
    return [Line(f"Twice that is {result.doubled:g}.")]


def draw(result: DrawnToy, unit: str) -> dict[str, Any]:
    return {"templates": {}, "figures": {}, "omitted": {"toy": f"{result.doubled:g} {unit}"}}


ANALYSIS = Analysis(
    name="doubling",
    resource="doublings",
    text=__doc__,
    outcome="Twice the number.",
    request=ToyRequest,
    result=ToyResult,
    compute=compute,
    table=table,
    figures=Figures(of="a doubling", drawn=DrawnToy, draw=draw),
)
'''

USE = """
import json, sys
from pathlib import Path
import service
from fastapi.testclient import TestClient
from service.client import Client
from service.configuration import Configuration
from service.http.app import create_app

def main():
    body = {"number": 1.5}
    # The kernels may have to be compiled first.
    configuration = Configuration(
        data_dir=Path(sys.argv[1]), workers=1, analysis_processes=1, analysis_time_limit=300
    )
    with TestClient(create_app(configuration)) as http, Client() as mutune:
        mutune._http = http
        figures = http.post("/v1/figures/doublings?unit=min", json={"doubled": 3.0, "more": 1})
        operation = http.get("/openapi.json").json()["paths"]["/v1/doublings"]["post"]
        print(json.dumps({
            "where": service.__file__,
            "response": http.post("/v1/doublings", json=body).json(),
            "refused": http.post("/v1/doublings", json={"number": -1.0}).json()["errors"],
            "figures": figures.json()["omitted"],
            "operation": [operation["summary"], operation["description"]],
            "input": operation["requestBody"]["content"]["application/json"]["schema"]["$ref"],
            "client": mutune.doubling(body).doubled,
        }))

if __name__ == "__main__":
    main()
"""


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the service and one file more in it."""
    folder = tmp_path_factory.mktemp("house")
    shutil.copytree(ROOT / "service", folder / "service")
    (folder / "service" / "analyses" / "toy_doubling.py").write_text(TOY)
    (folder / "use.py").write_text(USE)
    return folder


def run(house: Path, *arguments: str, text: str = "") -> str:
    """Return what a Python process says that has the service from there."""
    done = subprocess.run(  # noqa: S603 - our own interpreter and texts
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(house), str(ROOT)])},
        cwd=house,
        input=text,
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    return done.stdout


def test_one_file_brings_routes_schema_and_client_method(house: Path, tmp_path: Path) -> None:
    """Nothing but the file of the toy tells the service of it; it computes in a process."""
    said: dict[str, Any] = json.loads(run(house, "use.py", str(tmp_path)).splitlines()[-1])
    assert Path(said.pop("where")).is_relative_to(house)
    assert said == {
        "response": {"doubled": 3.0},
        "refused": [{"pointer": "/number", "detail": "negative numbers are not doubled"}],
        "figures": {"toy": "3 min"},
        "operation": ["Double a number", "Return twice the number of the request."],
        "input": "#/components/schemas/ToyRequest",
        "client": 3.0,
    }


def test_one_file_brings_a_command(house: Path) -> None:
    """It is listed with its help, prints its table, and its JSON result."""
    command = ("-c", "from service.cli import main; main()")
    assert "toy-doubling      Double a number." in run(house, *command, "--help")
    request = '{"number": 1.5}'
    assert run(house, *command, "toy-doubling", "-", text=request) == "Twice that is 3.\n"
    as_json = run(house, *command, "toy-doubling", "-", "--json", text=request)
    assert json.loads(as_json) == {"doubled": 3.0}


def test_names_and_resources_are_different() -> None:
    """Two analyses never share a path, a method or an operation."""
    found = registry.every()
    assert len(found) >= 8
    assert len({analysis.name for analysis in found}) == len(found)
    assert len({analysis.resource for analysis in found}) == len(found)


@pytest.mark.parametrize("name", registry.names())
def test_every_analysis_says_what_it_does(name: str) -> None:
    """Help is there without an import and is what the analysis itself says."""
    analysis = registry.load(name)
    assert registry.description(name).split() == analysis.text.split()
    assert analysis.summary
    assert analysis.description.endswith(".")
    method = getattr(Client, analysis.name)
    assert method.__doc__.startswith(analysis.summary)
    assert method.__annotations__["return"] is analysis.result


# That of a limit is computed, read and printed in test_limits.
@pytest.mark.parametrize("name", sorted({*registry.names()} - {"limit"}))
def test_example_of_the_documentation_is_computed_and_printed(name: str) -> None:
    """The result matches its model, and people can read it."""
    analysis = registry.load(name)
    (example,) = analysis.request.model_json_schema()["examples"]
    request = analysis.request.model_validate_json(json.dumps(example))
    text = json.dumps(analysis.compute(request), allow_nan=False)
    assert analysis.table(analysis.result.model_validate_json(text))
    if analysis.figures is not None:
        drawn = analysis.figures.drawn.model_validate_json(text)
        assert analysis.figures.draw(drawn, "min")["figures"]
