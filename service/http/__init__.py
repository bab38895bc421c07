"""HTTP: the app, its routes, and what surrounds them."""
