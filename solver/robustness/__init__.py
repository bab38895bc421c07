"""Robustness of given loops: mu over frequency, margins, worst cases, loops out of service."""
