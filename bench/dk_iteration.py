"""The limit beside D-K iteration: ``python -m bench.dk_iteration``, some minutes.

SLH's column at tau_P = 10 and their parallel plant at tau_P = 4, both rational. With dkpy and
slycot at hand (not dependencies: install them for this) dkpy's D-K iteration is run with D-scales
of several orders, mu by SLICOT's AB13MD, since its own bisection ends in an error of its solver on
the column; else its lines are left out.
Times are also told in sweeps of AB13MD over 121 frequencies, measured in the same run.
"""

import itertools
import sys
import time

import numpy as np
from ctrlsys import ab13md

from solver.limits.multivariable import multivariable_limit
from solver.limits.search import LimitSearch
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.centralised import analyse_centralised

USUAL = Uncertainty.from_error(0.2, 1)
GAINS = np.array([[0.878, -0.864], [1.082, -1.096]])
COLUMN = MatrixPlant([[TransferFunction((g,), (75, 1)) for g in row] for row in GAINS.tolist()])
OMEGA = np.logspace(-3, 3, 121)
PARALLEL = {
    "n = 2, tau = 100, a = 0.949": first_order(2, 1, 100, 0.949),
    "the same, n = 1000": first_order(1000, 1, 100, 0.949),
    "dead time 1": first_order(2, 1, 100, 0.949, 1.0),
}


def sweep():
    """Return the CPU seconds of one AB13MD sweep over 4 x 4 matrices."""
    rng = np.random.default_rng(1)
    matrices = rng.normal(size=(OMEGA.size, 4, 4)) + 1j * rng.normal(size=(OMEGA.size, 4, 4))
    sizes = np.array([1, 1, 2], dtype=np.int32)
    kinds = np.full(3, 2, dtype=np.int32)
    taken = []
    for _ in range(5):
        started = time.process_time()
        for matrix in matrices:
            ab13md(np.asfortranarray(matrix), sizes, kinds)
        taken.append(time.process_time() - started)
    return sorted(taken)[2]


def tell(name, value, states, seconds, unit):
    """Print a line."""
    sys.stdout.write(f"{name:34} {value:9.4f} {states:4d} states {seconds:7.1f} s CPU "
                     f"{seconds / unit:9.0f} sweeps\n")  # fmt: skip
    sys.stdout.flush()


def generalised(gains, lag, tau_p):
    """Return [w_I u; w_P y; -y], y = G (u + d) + w, from [d; w; u]; the integrator of w_P slow."""
    import control  # noqa: PLC0415

    def constant(parts):
        return control.ss([], [], [], np.block([parts]))

    none, eye = np.zeros((2, 2)), np.eye(2)
    plant = control.ss(-eye / lag, eye, gains / lag, none)
    output = plant * constant([eye, none, eye]) + constant([none, eye, none])
    w_I = control.tf2ss([1.0, 0.2], [0.5, 1.0])
    w_P = control.tf2ss([tau_p / 2, 0.5], [tau_p, 1e-6 * tau_p])
    moved = control.append(w_I, w_I) * constant([none, none, eye])
    parts = control.append(moved, control.append(w_P, w_P) * output, -1 * output)
    return control.minreal(parts * np.vstack([np.eye(6)] * 3), verbose=False)


def by_dkpy(unit):
    """Run dkpy's D-K iteration on its own copy of this column, and on the parallel plant."""
    import dkpy  # noqa: PLC0415 - may be missing
    import slycot  # noqa: PLC0415

    class ByAb13md(dkpy.StructuredSingularValue):
        """mu and its scales by SLICOT."""

        def compute_ssv(self, N_omega, block_structure=None):  # noqa: ARG002 - its interface
            bounds, scales = [], []
            for k in range(N_omega.shape[2]):
                bound, d, _, _ = slycot.ab13md(N_omega[:, :, k], np.array([1, 1, 2]), np.full(3, 2))
                bounds.append(bound)
                scales.append(np.diag(d / d[-1]))
            D = np.stack(scales, -1).astype(complex)
            return np.array(bounds), D, D, {}

    gains = np.array([[1.0, 0.949], [0.949, 1.0]])
    plants = {
        "column": dkpy.example_skogestad2006_p325()["P"],
        "parallel, tau_P = 4": generalised(gains, 100.0, 4.0),
    }
    blocks = [dkpy.ComplexFullBlock(1, 1), dkpy.ComplexFullBlock(1, 1), dkpy.ComplexFullBlock(2, 2)]
    for (name, plant), order in itertools.product(plants.items(), range(1, 6)):
        started = time.process_time()
        iteration = dkpy.DkIterListOrder(
            dkpy.HinfSynSlicot(), ByAb13md(), dkpy.DScaleFitSlicot(), fit_orders=[order] * 10
        )
        K, _, _, rounds, _ = iteration.synthesize(plant, 2, 2, OMEGA, blocks)
        best = min(float(np.max(each.mu_omega)) for each in rounds[1:])
        tell(f"dkpy, {name}, D of order {order}", best, K.nstates,
             time.process_time() - started, unit)  # fmt: skip


def main():
    """Print the table."""
    unit = sweep()
    sys.stdout.write(f"one AB13MD sweep of 121 frequencies: {1e3 * unit:.1f} ms\n")
    started = time.process_time()
    limit = multivariable_limit(COLUMN, USUAL, Performance(tau_p=10.0))
    taken = time.process_time() - started
    tell("column, limit at tau_P = 10: mu", limit.value, 0, taken, unit)
    if limit.realised is not None:
        robustness = limit.realised.robustness
        tell("built, mu", robustness.peaks.robust_performance.value, limit.realised.states,
             taken, unit)  # fmt: skip
        started = time.process_time()
        again = analyse_centralised(
            COLUMN, USUAL, Performance(tau_p=10.0), limit.realised.controller
        )
        tell(f"its proof ({again.guarantee.status.value})", again.guarantee.level,
             limit.realised.states, time.process_time() - started, unit)  # fmt: skip
    started = time.process_time()
    parallel = PARALLEL["n = 2, tau = 100, a = 0.949"]
    limit = multivariable_limit(parallel, USUAL, Performance(tau_p=4.0))
    tell("parallel, limit at tau_P = 4: mu", limit.value, 0, time.process_time() - started, unit)
    try:
        by_dkpy(unit)
    except ImportError as missing:
        sys.stdout.write(f"no dkpy: {missing}\n")
    for name, plant in PARALLEL.items():
        started = time.process_time()
        found = LimitSearch(plant, USUAL, Performance()).run()
        tell(f"{name}: tau_P", found.tau_p, 0, time.process_time() - started, unit)


if __name__ == "__main__":
    main()
