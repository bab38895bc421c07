"""Is `best` as good as every grouping? ``python -m bench.best [n] [share]``.

Parallel plants of 3 to 6 units, or of n alone, at four shares of the range of a, or at one: the
result of the arrangement "best" beside every partition of the units into groups, each searched for
itself. Prints by how many per cent it is behind the best of them; it may be by what one more group
must gain (0.01 %) or unlike settings must (1 %).
"""

import sys

import numpy as np

from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

USUAL = Uncertainty.from_error(0.2, 1)
WORTH_IT = 1.0  # per cent, from which unlike settings are preferred to like ones


def partitions(n, largest=None):
    """Yield the partitions of n as sizes, the greatest first."""
    if n == 0:
        yield ()
    for first in range(min(n, largest or n), 0, -1):
        for rest in partitions(n - first, first):
            yield (first, *rest)


def tau_p(plant, arrangement, sizes=None):
    """Return tau_P and the sizes of the groups."""
    found = tune(
        Specification(plant, USUAL, Performance(), arrangement=arrangement, group_sizes=sizes)
    )
    return found.tau_p or np.inf, tuple(sorted(map(len, found.groups), reverse=True))


def main():
    """Print a line a plant."""
    worst = 0.0
    for n in [int(sys.argv[1])] if len(sys.argv) > 1 else range(3, 7):
        for share in [float(sys.argv[2])] if len(sys.argv) > 2 else (-0.9, -0.5, 0.5, 0.9):
            plant = first_order(n, 1, 100, share if share > 0 else share / (n - 1))
            every = {sizes: tau_p(plant, Arrangement.GROUPED, sizes)[0] for sizes in partitions(n)}
            least = min(every, key=every.get)
            ours, chosen = tau_p(plant, Arrangement.BEST)
            behind = 100 * (ours / every[least] - 1)
            if len(chosen) > 1 or behind >= WORTH_IT:
                worst = max(worst, behind)
            print(
                f"n = {n} share {share:<5} best {ours:.6g} in {chosen}, of {len(every)} groupings "
                f"{every[least]:.6g} in {least}, behind {behind:+.4f} %",
                flush=True,
            )
    print(f"behind by {worst:.4f} % at most where unlike settings are worth it")


if __name__ == "__main__":
    main()
