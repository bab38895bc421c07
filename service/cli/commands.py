"""The commands, their arguments and their help; those of the analyses by their modules."""

from __future__ import annotations

import gc
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from service import registry
from service.batch.formats import Rows, SettingsForm, TableFormat
from service.cli.arguments import (
    AsJson,
    FormOption,
    Input,
    RowsOption,
    Scheduler,
    TableFormatOption,
    TimeUnit,
)

__all__ = ["app"]


class Order(StrEnum):
    """Order of the elements that are identified."""

    AUTO = "auto"
    FIRST = "first"
    SECOND = "second"


# Rich help costs 0.25 s of imports; plain help is as clear.
app = typer.Typer(
    name="mutune",
    help="Robust PI and PID settings for parallel units that disturb each other.",
    epilog=(
        "Exit codes: 0 done, 1 a fault of mutune, 2 bad input or setting, 3 infeasible, "
        "4 time limit, 5 the service could not start, 130 interrupted."
    ),
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:  # noqa: FBT001 - typer's form of a callback
    if wanted:
        from solver import __version__  # noqa: PLC0415 - only here

        typer.echo(f"mutune {__version__}")
        raise typer.Exit


def _begin_processes() -> None:
    """Let the processes that will compute do their imports while this one does its own."""
    from service.cli.interruption import raise_again  # noqa: PLC0415 - beside the next one
    from service.jobs import forking  # noqa: PLC0415 - only where processes are needed

    raise_again()
    forking.limit_threads()
    from service import registry  # noqa: PLC0415 - after that, with the libraries of both
    from service.jobs import pool  # noqa: F401, PLC0415 - likewise

    registry.every()
    forking.begin()


def _check_settings() -> None:
    """End where a setting has a value that it cannot have, before anything is started."""
    from service.jobs import forking  # noqa: PLC0415 - as above

    forking.limit_threads()
    from service.cli.outcomes import ExitCode, reported  # noqa: PLC0415 - NumPy comes with it
    from service.configuration import Configuration  # noqa: PLC0415 - likewise

    @reported
    def check() -> ExitCode:
        Configuration()
        return ExitCode.DONE

    if code := check():
        raise typer.Exit(code)


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
    time_unit: TimeUnit = None,
    limit: Annotated[
        bool,
        typer.Option("--limit", help="Say what other kinds of controllers could do."),
    ] = False,
) -> None:
    """Find the fastest robust loop settings."""
    # What is imported stays: looking through it a hundred times takes a tenth of a short command.
    gc.set_threshold(50_000)
    from service.cli.tuning import tune_file  # noqa: PLC0415 - heavy

    raise typer.Exit(
        tune_file(
            request,
            as_json=as_json,
            report=report,
            optimality_gap=optimality_gap,
            time_unit=time_unit,
            limit=limit,
        )
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
    format_: TableFormatOption = TableFormat.NDJSON,
    each: RowsOption = Rows.REQUEST,
    form: FormOption = SettingsForm.CASCADE,
    curves: Annotated[
        bool,
        typer.Option("--curves/--no-curves", help="Keep the curves, most of a result's size."),
    ] = True,
    check: Annotated[
        bool, typer.Option("--check", help="Check the requests and compute nothing.")
    ] = False,
) -> None:
    """Tune many requests, on all cores or more."""
    if check:
        from service.cli.batch import check_file  # noqa: PLC0415 - heavy

        raise typer.Exit(check_file(requests))
    _begin_processes()
    from service.cli.batch import batch_file  # noqa: PLC0415 - heavy

    raise typer.Exit(
        batch_file(
            requests,
            results=results,
            scheduler=scheduler,
            format_=format_,
            each=each,
            form=form,
            curves=curves,
        )
    )


@app.command()
def sweep(
    request: Input,
    *,
    vary: Annotated[
        list[str],
        typer.Option(
            metavar="NAME=FIRST:LAST:COUNT[:log] | NAME=VALUE,...", help="May be repeated."
        ),
    ],
    results: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Where to write. Default: stdout."),
    ] = None,
    scheduler: Scheduler = None,
    format_: TableFormatOption = TableFormat.CSV,
    each: RowsOption = Rows.REQUEST,
    form: FormOption = SettingsForm.CASCADE,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FIGURE.html", help="Draw what is reached over the varied field."),
    ] = None,
) -> None:
    """Tune a request with some of its fields varied, on a grid."""
    _begin_processes()
    from service.cli.batch import sweep_file  # noqa: PLC0415 - heavy

    raise typer.Exit(
        sweep_file(
            request,
            vary,
            results=results,
            scheduler=scheduler,
            format_=format_,
            each=each,
            form=form,
            figure=figure,
        )
    )


def _add_analysis(module: str) -> None:
    """Add the command of an analysis, which imports it when it runs."""

    @app.command(module.replace("_", "-"), help=registry.description(module))
    def command(request: Input, *, as_json: AsJson = False, time_unit: TimeUnit = None) -> None:
        from service.cli.analysing import analyse_file  # noqa: PLC0415 - heavy

        raise typer.Exit(analyse_file(module, request, as_json=as_json, time_unit=time_unit))


@app.command()
def identify(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="DATA.csv...", help="Records; or one request, FILE.json."),
    ],
    *,
    time: Annotated[
        str | None,
        typer.Option(
            metavar="COLUMN",
            help="Column of the times, by head or number; else by its name, or the first.",
        ),
    ] = None,
    inputs: Annotated[
        str, typer.Option(metavar="NAME,...", help="Columns of the inputs, in the loops' order.")
    ] = "",
    outputs: Annotated[
        str, typer.Option(metavar="NAME,...", help="Columns of the outputs, in the same order.")
    ] = "",
    identical: Annotated[
        bool, typer.Option("--identical", help="The units share their transfer functions.")
    ] = False,
    own_units: Annotated[
        bool, typer.Option("--own-units", help="Each unit has two transfer functions of its own.")
    ] = False,
    order: Annotated[Order, typer.Option(help="Of every element.")] = Order.AUTO,
    drift: Annotated[
        bool, typer.Option("--drift", help="The outputs drift; hides slow elements.")
    ] = False,
    validate: Annotated[
        list[Path] | None,
        typer.Option(metavar="DATA.csv", help="A record to predict only; may be repeated."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="REQUEST.json", help="Write a tuning request."),
    ] = None,
    scenarios: Annotated[
        bool,
        typer.Option(
            "--scenarios",
            help="Units and records that differ are scenarios of the request, not in its weight.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Identify a plant from records.

    Print the plant that they tell, standard errors, what they cannot tell, and the smallest
    uncertainty weight above all errors.
    """
    if len(files) == 1 and (files[0].suffix == ".json" or str(files[0]) == "-"):
        from service.cli.analysing import analyse_file  # noqa: PLC0415 - heavy

        raise typer.Exit(analyse_file("identify", files[0], as_json=as_json))
    from service.cli.identifying import Question, identify_files  # noqa: PLC0415 - heavy

    if identical and own_units:
        message = "--identical and --own-units exclude each other"
        raise typer.BadParameter(message)
    structure = "parallel" if identical else "units" if own_units else "matrix"
    question = Question(time, inputs, outputs, structure, order.value, drift)
    raise typer.Exit(
        identify_files(
            files, question, validate=validate or [], output=output, as_scenarios=scenarios,
            as_json=as_json,
        )
    )  # fmt: skip


# Commands above take more than a request.
_OWN_COMMAND = {"identify"}

for _module in registry.names():
    if _module not in _OWN_COMMAND:
        _add_analysis(_module)


@app.command()
def controllers(*, as_json: AsJson = False) -> None:
    """List the control systems that controller-forms knows."""
    from service.cli.starting import list_controllers  # noqa: PLC0415 - heavy

    raise typer.Exit(list_controllers(as_json=as_json))


@app.command()
def examples(
    name: Annotated[
        str | None, typer.Argument(help="Which one to print; without it they are listed.")
    ] = None,
) -> None:
    """List the example requests, or print one to start from."""
    from service.cli.starting import print_example  # noqa: PLC0415 - heavy

    raise typer.Exit(print_example(name))


@app.command()
def figure(
    name: Annotated[
        str | None, typer.Argument(help="Which one, as slh-7; without it they are listed.")
    ] = None,
    *,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Draw it: .html, or .svg, .png, .pdf, .webp."
        ),
    ] = None,
) -> None:
    """Compute a figure of the published sources, its numbers beside those stated there."""
    from service.cli.gallery import draw_figure  # noqa: PLC0415 - heavy

    raise typer.Exit(draw_figure(name, output))


@app.command()
def schema(
    command: Annotated[str, typer.Argument(metavar="COMMAND", help="tune, robustness, ...")],
) -> None:
    """Print the JSON schema of what FILE.json of a command holds."""
    from service.cli.starting import print_schema  # noqa: PLC0415 - heavy

    raise typer.Exit(print_schema(command))


@app.command()
def init(
    path: Annotated[
        Path, typer.Argument(metavar="FILE.json", help="Request to write; must not be there.")
    ] = Path("request.json"),
) -> None:
    """Ask about the plant and write a tuning request."""
    from service.cli.asking import write_request  # noqa: PLC0415 - heavy

    raise typer.Exit(write_request(path))


@app.command()
def verify(
    certificate: Annotated[
        Path, typer.Argument(metavar="CERTIFICATE.json", help="Certificate; - reads stdin.")
    ],
    *,
    sdp: Annotated[
        bool,
        typer.Option(
            "--sdp", help="Recompute mu at the peaks by semidefinite programming as well."
        ),
    ] = False,
) -> None:
    """Check a certificate from its file alone: exit 0 where it proves its claim, else 1."""
    from service.cli.verifying import verify_file  # noqa: PLC0415 - heavy

    raise typer.Exit(verify_file(certificate, sdp=sdp))


@app.command()
def serve(
    *,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0: any free port.")] = 8000,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Listen beyond this machine without API keys.")
    ] = False,
    certfile: Annotated[
        Path | None, typer.Option(metavar="CERT.pem", help="Serve HTTPS with this certificate.")
    ] = None,
    keyfile: Annotated[
        Path | None, typer.Option(metavar="KEY.pem", help="Its key, unless that is beside it.")
    ] = None,
) -> None:
    """Serve the HTTP API and the page."""
    _check_settings()
    _begin_processes()
    from service.cli.serving import serve as run  # noqa: PLC0415 - heavy

    raise typer.Exit(run(host, port, insecure=insecure, certfile=certfile, keyfile=keyfile))


@app.command()
def worker(
    *,
    scheduler: Scheduler = None,
    host: Annotated[
        str | None, typer.Option(help="Address to listen on. Default: that which it is reached by.")
    ] = None,
) -> None:
    """Compute for a Dask scheduler.

    On MUTUNE_WORKERS processes, by default one a core; until stopped.
    """
    _check_settings()
    _begin_processes()
    from service.cli.worker import work  # noqa: PLC0415 - heavy

    raise typer.Exit(work(scheduler, host))


@app.command()
def scheduler(
    *,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port to listen on.")] = 8786,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Listen beyond this machine without certificates.")
    ] = False,
) -> None:
    """Bring workers and services together."""
    from service.cli.worker import schedule  # noqa: PLC0415 - heavy

    raise typer.Exit(schedule(host, port, insecure=insecure))


keys = typer.Typer(help="API keys, in the file named by MUTUNE_API_KEYS_FILE.")
app.add_typer(keys, name="keys", no_args_is_help=True)


Days = Annotated[
    float | None, typer.Option(min=0, help="Days until the key ends. Default: as before, or never.")
]


@keys.command("create")
def create_key(
    name: Annotated[str, typer.Argument(help="Whose key it is.")],
    *,
    read_only: Annotated[bool, typer.Option("--read-only", help="May look, not start.")] = False,
    days: Days = None,
) -> None:
    """Create a key and print it; it cannot be shown again."""
    from service.cli.keys import create  # noqa: PLC0415 - heavy

    raise typer.Exit(create(name, read_only=read_only, days=days))


@keys.command("list")
def list_keys() -> None:
    """List the keys."""
    from service.cli.keys import listing  # noqa: PLC0415 - heavy

    raise typer.Exit(listing())


@keys.command("rotate")
def rotate_key(
    key_id: Annotated[str, typer.Argument(help="First column of the list.")],
    *,
    grace: Annotated[
        float, typer.Option(min=0, metavar="HOURS", help="How long the old secret is good too.")
    ] = 24.0,
    days: Days = None,
) -> None:
    """Give a key a new secret and print it; its jobs stay its own."""
    from service.cli.keys import rotate  # noqa: PLC0415 - heavy

    raise typer.Exit(rotate(key_id, grace=grace, days=days))


@keys.command("revoke")
def revoke_key(key_id: Annotated[str, typer.Argument(help="First column of the list.")]) -> None:
    """Remove a key."""
    from service.cli.keys import revoke  # noqa: PLC0415 - heavy

    raise typer.Exit(revoke(key_id))
