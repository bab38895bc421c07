"""Tunings as durable jobs: the table, the dispatcher, the engine that computes."""
