"""The commands, their arguments and their help."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Annotated

import typer

__all__ = ["app", "main"]

# Rich help costs 0.25 s of imports; plain help is as clear.
app = typer.Typer(
    name="mutune",
    help="Robust PI and PID settings for parallel units that disturb each other.",
    epilog="Exit codes: 0 done, 2 bad input, 3 infeasible, 4 time limit, 130 interrupted.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Input = Annotated[
    Path,
    typer.Argument(metavar="FILE.json", help="Request file; - reads standard input."),
]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON and nothing else on stdout.")
]

Scheduler = Annotated[
    str | None,
    typer.Option(
        envvar="MUTUNE_SCHEDULER", metavar="tcp://...", help="Dask scheduler to work with."
    ),
]


def _version(wanted: bool) -> None:  # noqa: FBT001 - typer's form of a callback
    if wanted:
        from importlib.metadata import version  # noqa: PLC0415 - only here

        typer.echo(f"mutune {version('mutune')}")
        raise typer.Exit


def _begin_processes() -> None:
    """Let the processes that will compute do their imports while this one does its own."""
    from service.jobs import forking  # noqa: PLC0415 - only where processes are needed

    forking.start()


@app.callback()
def _options(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Hold the options that stand before a command."""
    del version  # the callback has dealt with it


@app.command()
def tune(
    request: Input,
    *,
    as_json: AsJson = False,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="REPORT.html", help="Write a report to sign and file, one file with figures."
        ),
    ] = None,
    optimality_gap: Annotated[
        bool,
        typer.Option(
            "--optimality-gap", help="Prove how far the result is from the best possible one."
        ),
    ] = False,
) -> None:
    """Find the fastest robust loop settings."""
    # What is imported stays: looking through it a hundred times takes a tenth of a short command.
    gc.set_threshold(50_000)
    from service.cli.tuning import tune_file  # noqa: PLC0415 - heavy

    raise typer.Exit(
        tune_file(request, as_json=as_json, report=report, optimality_gap=optimality_gap)
    )


@app.command()
def batch(
    requests: Annotated[
        Path, typer.Argument(metavar="REQUESTS.ndjson", help="A request a line; - reads stdin.")
    ],
    *,
    results: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="RESULTS.ndjson",
            help="Where to write; a run that was stopped goes on here. Default: stdout.",
        ),
    ] = None,
    scheduler: Scheduler = None,
) -> None:
    """Tune many requests, on all cores or more."""
    _begin_processes()
    from service.cli.batch import batch_file  # noqa: PLC0415 - heavy

    raise typer.Exit(batch_file(requests, results=results, scheduler=scheduler))


@app.command()
def robustness(request: Input, *, as_json: AsJson = False) -> None:
    """Analyse given loop settings."""
    from service.cli.robustness import analyse_file  # noqa: PLC0415 - heavy

    raise typer.Exit(analyse_file(request, as_json=as_json))


@app.command()
def integrity(request: Input, *, as_json: AsJson = False) -> None:
    """Analyse given loops with any of them in manual."""
    from service.cli.integrity import analyse_file  # noqa: PLC0415 - heavy

    raise typer.Exit(analyse_file(request, as_json=as_json))


@app.command()
def interaction(request: Input, *, as_json: AsJson = False) -> None:
    """Analyse how loops interact and how to pair them."""
    from service.cli.interaction import analyse_file  # noqa: PLC0415 - heavy

    raise typer.Exit(analyse_file(request, as_json=as_json))


@app.command()
def decouple(request: Input, *, as_json: AsJson = False) -> None:
    """Design a static decoupler and the PI settings of its loops."""
    from service.cli.decoupling import decouple_file  # noqa: PLC0415 - heavy

    raise typer.Exit(decouple_file(request, as_json=as_json))


@app.command("parallel-drives")
def parallel_drives(request: Input, *, as_json: AsJson = False) -> None:
    """Analyse units with integral action on one load, and mend them."""
    from service.cli.parallel_drives import analyse_file  # noqa: PLC0415 - heavy

    raise typer.Exit(analyse_file(request, as_json=as_json))


@app.command("step-response")
def step_response(request: Input, *, as_json: AsJson = False) -> None:
    """Simulate how a plant and its loops move after steps."""
    from service.cli.step_response import simulate_file  # noqa: PLC0415 - heavy

    raise typer.Exit(simulate_file(request, as_json=as_json))


@app.command()
def relay(request: Input, *, as_json: AsJson = False) -> None:
    """Simulate a relay experiment and read loop settings off it."""
    from service.cli.relay import relay_file  # noqa: PLC0415 - heavy

    raise typer.Exit(relay_file(request, as_json=as_json))


@app.command()
def verify(
    certificate: Annotated[
        Path, typer.Argument(metavar="CERTIFICATE.json", help="Certificate; - reads stdin.")
    ],
) -> None:
    """Check a certificate from its file alone: exit 0 where it proves its claim, else 1."""
    from service.cli.verifying import verify_file  # noqa: PLC0415 - heavy

    raise typer.Exit(verify_file(certificate))


@app.command()
def serve(
    *,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0: any free port.")] = 8000,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Listen beyond this machine without API keys.")
    ] = False,
) -> None:
    """Serve the HTTP API and the page."""
    _begin_processes()
    from service.cli.serving import serve as run  # noqa: PLC0415 - heavy

    raise typer.Exit(run(host, port, insecure=insecure))


@app.command()
def worker(*, scheduler: Scheduler = None) -> None:
    """Compute for a Dask scheduler.

    On MUTUNE_WORKERS processes, by default one a core; until stopped.
    """
    _begin_processes()
    from service.cli.worker import work  # noqa: PLC0415 - heavy

    raise typer.Exit(work(scheduler))


keys = typer.Typer(help="API keys, in the file named by MUTUNE_API_KEYS_FILE.")
app.add_typer(keys, name="keys", no_args_is_help=True)


@keys.command("create")
def create_key(
    name: Annotated[str, typer.Argument(help="Whose key it is.")],
    *,
    read_only: Annotated[bool, typer.Option("--read-only", help="May look, not start.")] = False,
) -> None:
    """Create a key and print it; it cannot be shown again."""
    from service.cli.keys import create  # noqa: PLC0415 - heavy

    raise typer.Exit(create(name, read_only=read_only))


@keys.command("list")
def list_keys() -> None:
    """List the keys."""
    from service.cli.keys import listing  # noqa: PLC0415 - heavy

    raise typer.Exit(listing())


@keys.command("revoke")
def revoke_key(key_id: Annotated[str, typer.Argument(help="First column of the list.")]) -> None:
    """Remove a key."""
    from service.cli.keys import revoke  # noqa: PLC0415 - heavy

    raise typer.Exit(revoke(key_id))


def main() -> None:
    """Run the command line."""
    app()
