"""Interaction between loops: relative gains, pairing, zeros, decoupling, integrity."""
