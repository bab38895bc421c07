"""Robust tuning of decentralised PI and PID controllers for identical parallel processes."""

from importlib.metadata import version

__all__ = ["__version__"]

__version__ = version("mutune")
