"""Random loops far from the usual ones, and checks of them that share no code with the solver.

Responses, N_RP, scaled norms and the winding count are written out here anew, with numpy and scipy
alone: a mistake that the solver and this file make alike would have to be made twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, ParallelPlant, Plant
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty

POINTS = 20_000
REFINED = 40  # of a bracket in each of three rounds
CANDIDATES = 3


@dataclass(frozen=True)
class UnusualLoop:
    """A drawn loop."""

    plant: Plant
    uncertainty: Uncertainty
    performance: Performance
    loops: tuple[Controller, ...]


def draw(rng: np.random.Generator) -> UnusualLoop:
    """Orders 1 to 6, dead time 0 to 10, integrators, feedthrough, weak damping, n 1 to 6."""
    n = int(rng.integers(1, 7))
    rate = 10 ** rng.uniform(-3, 3)  # the plant's own, rad per time unit
    size = 10 ** rng.uniform(-6, 6)
    if rng.random() < 0.4:
        process = _element(rng, rate, size)
        share = rng.choice([rng.uniform(-1, 1) / max(n - 1, 1), 1 - 10 ** rng.uniform(-7, -1)])
        alike = rng.random() < 0.6
        other = process if alike else _element(rng, rate, size)
        factor = share if alike else 0.3 * share
        num = [factor * c for c in other.num]
        plant: Plant = ParallelPlant(n, process, TransferFunction(num, other.den, other.dead_time))
        slots = [Controller(*_settings(rng, rate, size)) for _ in range(int(rng.integers(1, 3)))]
        loops = tuple(slots[unit % len(slots)] for unit in range(n))
    else:
        coupling = rng.uniform(0, 1)
        plant = MatrixPlant(
            [
                [_element(rng, rate, size * (1 if r == c else coupling / n)) for c in range(n)]
                for r in range(n)
            ]
        )
        loops = tuple(Controller(*_settings(rng, rate, size)) for _ in range(n))
    theta = rng.choice([0.0, 10 ** rng.uniform(-3, 2)]) / rate
    return UnusualLoop(
        plant,
        Uncertainty.from_error(10 ** rng.uniform(-3, -0.3), theta),
        Performance(max_peak=rng.uniform(1.2, 10), tau_p=10 ** rng.uniform(-1, 3) / rate),
        loops,
    )


def draw_any(rng: np.random.Generator) -> UnusualLoop:
    """As `draw`, with every kind of controller and a full uncertainty too."""
    drawn = draw(rng)
    structure = rng.choice([Structure.DIAGONAL, Structure.FULL])
    kind = rng.choice(["P", "PI", "PD", "PID", "PIF", "PIDF"])
    reset = 1 / np.median([each.integral_time or 1.0 for each in drawn.loops])
    changed = {}
    for each in dict.fromkeys(drawn.loops):
        lead, lag = 10 ** rng.uniform(-2, 1, 2) / reset
        changed[each] = Controller(
            each.gain,
            each.integral_time if "I" in kind else None,
            lead if "D" in kind else None,
            lag if "F" in kind else None,
        )
    offset = 0.0 if "I" in kind else 10 ** rng.uniform(-3, 0)
    if "I" in kind and rng.random() < 0.2:  # one of the settings without integral action
        first = drawn.loops[0]
        changed[first] = replace(changed[first], integral_time=None)
        offset = 10 ** rng.uniform(-3, 0)
    return replace(
        drawn,
        uncertainty=Uncertainty(drawn.uncertainty.weight, Structure(structure)),
        performance=replace(drawn.performance, offset=offset),
        loops=tuple(changed[each] for each in drawn.loops),
    )


def _element(rng: np.random.Generator, rate: float, size: float) -> TransferFunction:
    order = int(rng.integers(1, 7))
    poles: list[complex] = []
    while len(poles) < order:
        corner = rate * 10 ** rng.uniform(-1, 1)
        if order - len(poles) > 1 and rng.random() < 0.4:
            damping = 10 ** rng.uniform(-4, 0)
            pole = corner * complex(-damping, np.sqrt(1 - damping**2))
            poles += [pole, pole.conjugate()]
        else:
            poles.append(-corner)
    den = np.real(np.poly(poles))
    gain = size * den[-1] * rng.choice([-1, 1], p=[0.1, 0.9])
    kind = rng.random()
    if kind < 0.15:  # one integrator in place of the slowest pole's level
        den = np.append(den[:-1], 0.0)
        den = den if den[-2] else np.array([1.0, 0.0])
    num = np.array([gain])
    if kind > 0.85:  # feedthrough
        num = gain * np.poly(-rate * 10 ** rng.uniform(-1, 1, order)) / den[0]
        num = num / num[-1] * gain
    elif kind > 0.7:  # a zero, to the left or to the right
        num = gain * np.array([rng.choice([-1, 1]) / (rate * 10 ** rng.uniform(-1, 1)), 1.0])
    if np.any(np.roots(den[den != 0]).real > 0):
        den = np.real(np.poly([-rate] * order))
    largest = max(np.abs(num).max(), np.abs(den).max())
    scale = max(1.0, largest / 1e11)
    dead_time = rng.choice([0.0, rng.uniform(0, 10)]) / rate
    return TransferFunction(num[: order + 1] / scale, den / scale, dead_time)


def _settings(rng: np.random.Generator, rate: float, size: float) -> tuple[float, float]:
    return 10 ** rng.uniform(-3, 1.3) / size, 10 ** rng.uniform(-1, 2) / rate


def response(function: TransferFunction, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    """num/den exp(-theta s), both polynomials scaled so that no power overflows."""
    s = 1j * omega
    num, den = np.array(function.num), np.array(function.den)
    return np.polyval(num, s) / np.polyval(den, s) * np.exp(-function.dead_time * s)


def controller(loop: Controller, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    """k (1 + 1/(tau_I s)) (1 + tau_D s)/(1 + tau_F s), what is absent left out."""
    s = 1j * omega
    value = np.full(omega.size, loop.gain, complex)
    if loop.integral_time is not None:
        value *= 1 + 1 / (loop.integral_time * s)
    tau_D, tau_F = loop.derivative_time, loop.filter_time
    if tau_D is not None:
        value *= 1 + tau_D * s
        tau_F = 0.1 * tau_D if tau_F is None else tau_F
    return value if tau_F is None else value / (1 + tau_F * s)


def full_plant(plant: Plant, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    """All n x n responses."""
    G = np.empty((omega.size, plant.n, plant.n), complex)
    for r in range(plant.n):
        for c in range(plant.n):
            G[:, r, c] = response(plant.element(r, c), omega)
    return G


def matrices(loop: UnusualLoop, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    """N_RP (k, 2n, 2n) of all channels."""
    n = loop.plant.n
    G = full_plant(loop.plant, omega)
    C = np.stack([controller(each, omega) for each in loop.loops], axis=1)[:, :, None] * np.eye(n)
    S = np.linalg.inv(np.eye(n) + G @ C)
    w_I = response(loop.uncertainty.weight, omega)[:, None, None]
    tau_p, M = loop.performance.tau_p, loop.performance.max_peak
    lag = 1j * omega * tau_p
    w_P = ((lag + 1) / (M * lag + loop.performance.offset))[:, None, None]
    CS = C @ S
    top = np.concatenate([-w_I * CS @ G, -w_I * CS], axis=2)
    bottom = np.concatenate([w_P * S @ G, w_P * S], axis=2)
    return np.concatenate([top, bottom], axis=1)


def rough_bound(N: NDArray[np.complex128], *, full: bool = False) -> NDArray[np.float64]:
    """sigma_max(D N D^-1) for scales that balance rows and columns: a bound, not the best."""
    d = _balanced(N, full=full)
    scaled = d[:, :, None] * N / d[:, None, :]
    sound = np.isfinite(scaled).all(axis=(1, 2))  # 0/0 far beyond the dynamics
    values = np.zeros(len(N))
    values[sound] = np.linalg.norm(scaled[sound], ord=2, axis=(1, 2))
    return values


def _balanced(N: NDArray[np.complex128], *, full: bool = False) -> NDArray[np.float64]:
    n = N.shape[1] // 2
    square = np.abs(N) ** 2
    d2 = np.ones(N.shape[:2])
    if full:  # one scale: off-diagonal quarters alike
        rows, columns = square[:, :n, n:].sum(axis=(1, 2)), square[:, n:, :n].sum(axis=(1, 2))
        d2[:, :n] = np.sqrt((columns + 1e-300) / (rows + 1e-300))[:, None]
        return np.sqrt(d2)
    for _ in range(30):
        for i in range(n):
            weighted = square * d2[:, :, None] / d2[:, None, :]
            row = weighted[:, i].sum(axis=1) - weighted[:, i, i]
            column = weighted[:, :, i].sum(axis=1) - weighted[:, i, i]
            d2[:, i] *= np.sqrt((column + 1e-300) / (row + 1e-300))
        if n == 1:
            break
    return np.sqrt(d2)


def best_bound(N: NDArray[np.complex128], *, full: bool = False) -> float:
    """Upper bound of mu of one matrix, minimised over log d by a general-purpose method."""
    n = N.shape[0] // 2
    if n == 1:  # the scalar loop: |w_I T| + |w_P S|
        return float(abs(N[0, 0]) + abs(N[1, 1]))

    def norm(log_d: NDArray[np.float64]) -> float:
        d = np.exp(np.append(np.broadcast_to(log_d, n), np.zeros(n)))
        return float(np.log(np.linalg.norm(d[:, None] * N / d, ord=2)))

    start = np.log(_balanced(N[None], full=full)[0, : 1 if full else n])
    options = {"xatol": 1e-10, "fatol": 1e-13, "maxiter": 4000, "maxfev": 6000, "adaptive": True}
    best = minimize(norm, start, method="Nelder-Mead", options=options)
    # A simplex may collapse before the minimum: from a new one it goes on.
    best = minimize(norm, best.x, method="Nelder-Mead", options=options)
    return float(np.exp(best.fun))


def dense_grid(loop: UnusualLoop, points: int = POINTS) -> NDArray[np.float64]:
    """Points over all that the loop does, denser at its lightly damped poles."""
    corners = [1 / loop.performance.tau_p]
    extra = []
    for element in loop.plant.elements:
        roots = np.concatenate([np.roots(element.den), np.roots(element.num)])
        corners += [abs(root) for root in roots if abs(root) > 0]
        corners += [1 / element.dead_time] if element.dead_time else []
        extra += [
            root.imag + np.linspace(-20, 20, points // 100) * abs(root.real)
            for root in roots[roots.imag > 0]
        ]
    for each in loop.loops:
        times = (each.integral_time, each.derivative_time, each.filter_time)
        corners += [1 / time for time in times if time is not None]
    low, high = 1e-5 * min(corners), 1e5 * max(corners)
    found = np.concatenate([np.geomspace(low, high, points), *extra])
    return np.unique(found[found > 0])


def dense_peak(loop: UnusualLoop, reported: float, points: int = POINTS) -> float:
    """Highest upper bound of mu that a dense grid with refinement finds; 0 if below `reported`."""
    omega = dense_grid(loop, points)
    full = loop.uncertainty.structure is Structure.FULL
    values = rough_bound(matrices(loop, omega), full=full)
    order = np.argsort(-values)
    highest = 0.0
    taken: list[int] = []
    for index in order:
        if len(taken) == CANDIDATES or values[index] < reported:
            break
        if any(abs(index - other) < 100 for other in taken):
            continue
        taken.append(int(index))
        low, high = omega[max(index - 1, 0)], omega[min(index + 1, omega.size - 1)]
        for _ in range(3):
            inside = np.geomspace(low, high, REFINED)
            rough = rough_bound(matrices(loop, inside), full=full)
            top = int(np.argmax(rough))
            low, high = inside[max(top - 1, 0)], inside[min(top + 1, REFINED - 1)]
        at = np.array([inside[top], omega[index]])
        highest = max(highest, *(best_bound(N, full=full) for N in matrices(loop, at)))
    return highest


def unstable_count(loop: UnusualLoop, points: int = POINTS) -> int | None:
    """Closed-loop poles to the right, by the winding of det(I + L); None where it is unclear."""
    n = loop.plant.n

    def determinant(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        C = np.stack([controller(each, omega) for each in loop.loops], axis=1)
        sign, _ = np.linalg.slogdet(np.eye(n) + full_plant(loop.plant, omega) * C[:, None, :])
        return sign

    grid = dense_grid(loop, points)
    low = grid[0]
    for _ in range(12):
        C = np.stack([controller(each, np.array([low, low / 10])) for each in loop.loops], axis=1)
        L = full_plant(loop.plant, np.array([low, low / 10])) * C[:, None, :]
        _, size = np.linalg.slogdet(np.eye(n) + L)
        slope = (size[1] - size[0]) / np.log(10)
        turned = determinant(np.array([low]))[0] * 1j ** round(slope)
        if abs(slope - round(slope)) < 1e-3 and abs(turned.imag) < 1e-2:
            break
        low /= 10
    else:
        return None
    order = round(slope)
    omega = np.concatenate([np.geomspace(low, grid[0], 2000)[:-1], grid]) if low < grid[0] else grid
    values = determinant(omega)
    for _ in range(40):
        turn = np.abs(np.angle(values[1:] * values[:-1].conj()))
        where = np.flatnonzero(turn > 0.5)
        if not where.size:
            break
        if omega.size > 400_000:
            return None
        middle = 0.5 * (omega[where] + omega[where + 1])
        values = np.insert(values, where + 1, determinant(middle))
        omega = np.insert(omega, where + 1, middle)
    else:
        return None
    end = values[-1]
    if abs(end.imag) > 0.05:
        return None
    total = np.angle(values[1:] * values[:-1].conj()).sum()
    total += np.angle(turned if turned.real > 0 else -turned)
    total -= np.angle(end if end.real > 0 else -end)
    count = order / 2 - total / np.pi
    return round(count) if abs(count - round(count)) < 0.05 else None
