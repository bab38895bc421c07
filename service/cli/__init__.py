"""The command line ``mutune``. Its commands import what is heavy only when they run."""

from service.cli.interruption import end_at_once, leave

__all__ = ["main"]


def main() -> None:
    """Run the command line."""
    end_at_once()  # before the imports, which take a moment
    from service.cli.commands import app  # noqa: PLC0415 - see above

    try:
        app()
    except SystemExit as ended:
        leave(ended.code if isinstance(ended.code, int) else int(ended.code is not None))
        raise
