"""The command line ``mutune``. Its commands import what is heavy only when they run."""

from service.cli.commands import app, main

__all__ = ["app", "main"]
