"""Nominal stability of closed loops, dead time exact."""
