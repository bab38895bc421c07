"""Start the service, tune ``examples/parallel_reactors.json`` over HTTP, print what comes out.

Called by ``scripts/run``. Serves on until Ctrl-C; with ``--once`` it ends after the result.
"""

from __future__ import annotations

import argparse
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from service.cli.console import to_rich
from service.cli.tables import side_by_side
from service.client import Client, JobEndedError, ServiceUnreachableError
from service.printing import Grid
from service.schemas import TuningResult
from service.wording import number

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "examples" / "parallel_reactors.json"
LOG = ROOT / "build" / "service.log"
HOST = "127.0.0.1"
PORT = 8000
START_LIMIT = 120.0  # seconds; on a slow machine the first import alone takes some

console = Console()


class ServiceStoppedError(Exception):
    """The service ended by itself."""


def main() -> int:
    """Run the tour; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--once", action="store_true", help="end after the result")
    once = parser.parse_args().once
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # stops like Ctrl-C
    port = free_port()
    url = f"http://{HOST}:{port}"
    try:
        with serving(url, port) as process:
            console.print(to_rich([tour(url)]))
            console.print(f"\nPage:              {url}/")
            console.print(f"API documentation: {url}/docs")
            if once:
                return 0
            console.print("The service runs on; Ctrl-C stops it.")
            process.wait()
    except KeyboardInterrupt:
        console.print("\nStopped.")
        return 0
    except (JobEndedError, ServiceUnreachableError) as error:
        console.print(f"The example could not be tuned: {error}")
        return 1
    except ServiceStoppedError:
        pass
    console.print(f"The service stopped by itself. The end of its log, {LOG}:")
    console.print("".join(LOG.read_text().splitlines(keepends=True)[-20:]), markup=False)
    return 1


def free_port() -> int:
    """Return the usual port, or where it is taken a free one."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, PORT))
        except OSError:
            probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
    if port != PORT:
        console.print(f"Port {PORT} is taken; the service uses {port}.")
    return port


@contextmanager
def serving(url: str, port: int) -> Iterator[subprocess.Popen[bytes]]:
    """Run the service until the end of the block."""
    console.print(f"Starting the service; its log is {LOG.relative_to(ROOT)}.")
    LOG.parent.mkdir(exist_ok=True)
    program = str(Path(sys.executable).with_name("mutune"))
    with LOG.open("wb") as log:
        process = subprocess.Popen(  # noqa: S603 - our own program
            [program, "serve", "--host", HOST, "--port", str(port)], stdout=log, stderr=log
        )
    try:
        wait_until_ready(url, process)
        yield process
    finally:
        process.terminate()
        process.wait()


def wait_until_ready(url: str, process: subprocess.Popen[bytes]) -> None:
    """Return once the service has its workers."""
    deadline = time.monotonic() + START_LIMIT
    while time.monotonic() < deadline and process.poll() is None:
        try:
            if httpx.get(f"{url}/readyz").is_success:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.2)
    raise ServiceStoppedError


def tour(url: str) -> Grid:
    """Tune the example with identical and with independent settings; return the table."""
    request = json.loads(EXAMPLE.read_text())
    results: dict[str, TuningResult] = {}
    columns = (
        TextColumn("{task.description:12}"),
        BarColumn(),
        TextColumn("best τP {task.fields[best]}"),
        TimeElapsedColumn(),
    )
    with Client(url) as client, Progress(*columns, console=console) as bar:
        for arrangement in ("identical", "independent"):
            task = bar.add_task(arrangement, total=1.0, best="-")
            request["controller"]["arrangement"] = arrangement
            results[arrangement] = client.tune(
                request,
                lambda progress, task=task: bar.update(  # type: ignore[misc]
                    task, completed=progress.fraction, best=number(progress.best)
                ),
            )
            bar.update(task, completed=1.0, best=number(results[arrangement].tau_p))
    return side_by_side(results)


if __name__ == "__main__":
    sys.exit(main())
