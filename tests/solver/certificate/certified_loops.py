"""Loops for the tests of certificates, and mu of the whole, unreduced loop."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray
from zoo import interactions

from solver.certificate.record import Certificate, Claim
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.robustness.curves import LoopAnalysis

# Skogestad, Lundstrom and Hovd (1989), section 5: independent loops, tau_P = 19.
PUBLISHED_PEAK = 1.00034840
PUBLISHED = (
    first_order(2, 1, 100, 0.949),
    Uncertainty.from_error(0.2, 1),
    Performance(tau_p=19.0),
    (Controller(46.3, 101.0), Controller(22.8, 3.15)),
)


def published(gamma: float) -> Claim:
    """Return the claim that the published loops have mu <= gamma."""
    return Claim(*PUBLISHED, gamma)


@st.composite
def loops_to_certify(
    draw: st.DrawFn,
) -> tuple[Plant, Uncertainty, Performance, tuple[Controller, ...]]:
    """Draw loops that are mostly stable: lags, oscillators, integrators, with dead time or not."""
    n = draw(st.integers(1, 4))
    tau = 10 ** draw(st.floats(-1, 3))
    dead_time = tau * draw(st.sampled_from([0.0, 0.0, 0.05, 0.5]))
    interaction = draw(interactions(-0.8 / max(n - 1, 1), 0.95))
    other_lag = TransferFunction([interaction], [tau * draw(st.floats(0.5, 2)), 1], dead_time * 1.5)
    damping = draw(st.floats(0.3, 1))
    oscillator = TransferFunction([1], [tau**2, 2 * damping * tau, 1], dead_time)
    plant = draw(
        st.sampled_from(
            [
                first_order(n, 1, tau, interaction, dead_time),
                ParallelPlant(n, oscillator, other_lag),
                ParallelPlant(n, TransferFunction([1], [tau, 0], dead_time), other_lag),
                MatrixPlant(
                    [[oscillator, other_lag], [other_lag, TransferFunction([1], [tau, 1])]]
                ),
            ]
        )
    )
    uncertainty = Uncertainty.from_error(
        draw(st.floats(0.05, 0.4)),
        tau * 10 ** draw(st.floats(-1.5, -0.5)),
        draw(st.sampled_from(Structure)),
    )
    fastest = 0.5 if dead_time else 5.0
    settings = st.builds(
        Controller,
        st.floats(0.05, fastest),
        st.floats(0.5 * tau, 3 * tau),
        st.none() | st.floats(0.05 * tau, 0.3 * tau),
        st.none() | st.floats(0.005 * tau, 0.1 * tau),
    )
    different = draw(st.lists(settings, min_size=1, max_size=2))
    loops = tuple(different[unit % len(different)] for unit in range(plant.n))
    performance = Performance(
        offset=draw(st.sampled_from([0.0, 0.1])), tau_p=tau * draw(st.floats(0.5, 5))
    )
    return plant, uncertainty, performance, loops


def mu_over(
    omega: NDArray[np.float64],
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: tuple[Controller, ...],
) -> NDArray[np.float64]:
    """Return the upper bound of mu at the frequencies `omega`, (k,)."""
    blocks, controllers = group_loops(plant, loops, uncertainty)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    return analysis.robust_performance(omega)


def peak_of(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: tuple[Controller, ...],
) -> float:
    """Return the peak of mu on 1000 frequencies and on 40 more about each of the highest."""
    task = (plant, uncertainty, performance, loops)
    omega = np.geomspace(1e-4, 1e5, 1000) / loops[0].integral_time
    mu = mu_over(omega, *task)
    inner = mu[1:-1]
    high = (inner >= mu[:-2]) & (inner >= mu[2:]) & (inner > 0.9 * mu.max())
    around = [np.geomspace(omega[k], omega[k + 2], 40) for k in np.flatnonzero(high)[:10]]
    return float(max(mu.max(), *(mu_over(points, *task).max() for points in around), 0))


def level_at(omega: NDArray[np.float64], certificate: Certificate) -> NDArray[np.float64]:
    """Return sigma_max(D N D^-1) of the whole loop with the certificate's own D, (k,)."""
    claim = certificate.claim
    n = claim.plant.n
    G = claim.plant.response(omega)
    C = np.stack([loop.response(omega) for loop in claim.loops], axis=-1)
    S = np.linalg.inv(np.eye(n) + G * C[:, None, :])
    right = np.concatenate([S @ G, S], axis=2)
    w_I, w_P = claim.uncertainty.magnitude(omega), claim.performance.magnitude(omega)
    N = np.concatenate([w_I[:, None, None] * C[:, :, None] * right, w_P[:, None, None] * right], 1)
    highs = [proven.interval.high for proven in certificate.intervals]
    d = np.ones((omega.size, 2 * n))
    d[:, :n] = [
        _scale_of_each_loop(claim, certificate.intervals[index].scales)
        for index in np.searchsorted(highs, omega)
    ]
    return np.asarray(np.linalg.norm(d[:, :, None] * N / d[:, None, :], 2, axis=(1, 2)))


def _scale_of_each_loop(claim: Claim, scales: tuple[float, ...]) -> list[float]:
    if claim.uncertainty.structure is Structure.FULL:
        return list(scales) * claim.plant.n
    if isinstance(claim.plant, MatrixPlant):
        return list(scales)
    different = list(dict.fromkeys(claim.loops))
    return [scales[different.index(loop)] for loop in claim.loops]
