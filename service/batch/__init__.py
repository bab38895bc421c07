"""Batches from the command line: request lines, the file of results, the run, tables."""
