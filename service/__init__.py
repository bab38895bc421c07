"""HTTP service and command line over the solver."""
