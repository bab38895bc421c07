"""The command line ``mutune``. Its commands import what is heavy only when they run."""

from service.cli.interruption import end_at_once

__all__ = ["main"]


def main() -> None:
    """Run the command line."""
    end_at_once()  # before the imports, which take a moment
    from service.cli.commands import app  # noqa: PLC0415 - see above

    app()
