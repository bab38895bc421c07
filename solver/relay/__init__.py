"""Relay feedback: experiments, periodic solutions, ultimate points, settings."""
