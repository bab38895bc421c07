"""The loop sheet of a tuning: how the loops will behave, and what can go wrong with them."""
