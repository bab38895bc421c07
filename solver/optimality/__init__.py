"""How far tuned settings can be from the best ones: a proven lower bound of tau_P."""
