"""Interaction between loops: relative gains, pairing, zeros, decoupling, drives on one load."""
