"""Robust tuning of decentralised PI and PID controllers for identical parallel processes."""

__all__ = ["__version__"]

__version__ = "0.1.0"  # of the whole project: the build reads it here
