"""The numerical library: plants, mu, tuning, analyses, time responses, identification, limits.

Its public name is `mutune`.
"""

__all__ = ["__version__"]

__version__ = "0.1.0"  # of the whole project: the build reads it here
