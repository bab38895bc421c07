"""What the process that answers requests holds in memory, and what those that compute hold."""

from __future__ import annotations

import json
import subprocess
import sys

# The service is started, so that whatever its start imports is there too.
SERVICE = """
import json, sys
from pathlib import Path
from fastapi.testclient import TestClient
from service.configuration import Configuration
from service.http.app import create_app

def main():
    app = create_app(Configuration(data_dir=Path(sys.argv[1]), workers=1, analysis_processes=1))
    with TestClient(app) as http:
        request = {"loops": [{"gain": 1.0, "integral_time": 2.0}]}
        status = http.post("/v1/controller-forms", json=request).status_code
        modules = [name for name in sys.modules if "." not in name or name.startswith("scipy.")]
        print(json.dumps([status, len(app.openapi()["paths"]), modules]))

if __name__ == "__main__":
    main()
"""

# A process forked from the server of the workers, before and after it has computed everything.
COMPUTING = """
import json, sys
from service import registry
from service.jobs import processes

def held():
    return sorted(name for name in sys.modules if name.split(".")[0] in ("numba", "solver"))

def compute(connection):
    before, missing = held(), {}
    for name in registry.names():
        analysis = registry.load(name)
        (example,) = analysis.request.model_json_schema()["examples"]
        if name == "limit":  # what it computes with is loaded before its time is up
            example = {**example, "search": {"time_limit": 2}}
        analysis.compute(analysis.request.model_validate_json(json.dumps(example)))
        missing[name] = sorted(set(held()) - set(before))
    connection.send([before, missing])

def main():
    context = processes.prepare()
    ours, theirs = context.Pipe()
    process = context.Process(target=compute, args=(theirs,))
    process.start()
    print(json.dumps(ours.recv()))
    process.join()

if __name__ == "__main__":
    main()
"""


def run(tmp_path, text):
    script = tmp_path / "script.py"
    script.write_text(text)
    done = subprocess.run(  # noqa: S603 - our own interpreter and text
        [sys.executable, str(script), str(tmp_path)],
        capture_output=True,
        check=True,
        text=True,
        timeout=300,
    )
    return json.loads(done.stdout.splitlines()[-1])  # the log of the service stands before it


def test_the_service_holds_no_compiled_kernels(tmp_path) -> None:
    """It queues tunings and hands analyses on; numba alone would be a quarter of its memory."""
    status, paths, modules = run(tmp_path, SERVICE)
    assert status == 200
    assert paths > 20
    assert {"service", "solver", "fastapi", "pydantic"} <= set(modules)
    assert not {"numba", "plotly", "flint", "scipy.linalg", "scipy.optimize"} & set(modules)


def test_processes_that_compute_hold_all_that_they_need(tmp_path) -> None:
    """Kernels are there when they are forked, and no analysis imports more of the solver."""
    before, missing = run(tmp_path, COMPUTING)
    assert {"numba", "solver.mu.kernel", "solver.robustness.analysis"} <= set(before)
    assert missing
    assert not {name: modules for name, modules in missing.items() if modules}
