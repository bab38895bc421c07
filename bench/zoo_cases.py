"""The plants of the zoo, as tuning requests: published ones with their sources, and families."""

import numpy as np

USUAL = {"epsilon": 0.2, "theta": 1}
NONE = {"num": [0], "den": [1]}


def cases():
    """Yield name, source, and request of every case."""
    for name, source, plant, more in plants():
        for kind in more.get("kinds", ("PI", "PID")):
            for arrangement in more.get("arrangements", ("independent",)):
                request = {
                    "plant": plant,
                    "uncertainty": more.get("uncertainty", USUAL),
                    "performance": more.get("performance", {"max_peak": 2}),
                    "controller": {"kind": kind, "arrangement": arrangement},
                    "search": {"time_limit": 600},
                }
                yield f"{name}, {kind} {arrangement}", source, request


def plants():
    """Yield name, source, plant, and what differs from the usual of each."""
    yield from published()
    yield from parallel()
    yield from integrating()
    yield from single()
    yield from scaled()
    yield from matrices()


def element(num, den, dead_time=0.0):
    """Return a transfer function."""
    return {"num": num, "den": den, "dead_time": dead_time}


def matrix(rows):
    """Return a matrix plant of (num, den, dead time)."""
    return {"kind": "matrix", "elements": [[element(*each) for each in row] for row in rows]}


def published():
    """Plants from papers."""
    both = {"arrangements": ("identical", "independent")}
    for tau in (10, 100):
        for a in (0, 0.827, 0.949, 0.984, 0.995):
            yield f"SLH tau {tau} a {a}", "Skogestad, Lundstrom and Hovd 1989, tables 1 to 4", {
                "kind": "first_order", "n": 2, "gain": 1, "time_constant": tau, "interaction": a,
            }, both  # fmt: skip
    lag = [75, 1]
    yield (
        "column",
        "Skogestad, Lundstrom and Hovd 1989, eq. 3",
        matrix([[([0.878], lag), ([-0.864], lag)], [([-1.082], lag), ([1.096], lag)]]),
        {},
    )
    yield "Wood and Berry", "Wood and Berry 1973", matrix(
        [[([12.8], [16.7, 1], 1), ([-18.9], [21, 1], 3)],
         [([6.6], [10.9, 1], 7), ([-19.4], [14.4, 1], 3)]]
    ), {}  # fmt: skip
    yield "Vinante and Luyben", "Vinante and Luyben 1972", matrix(
        [[([-2.2], [7, 1], 1), ([1.3], [7, 1], 0.3)],
         [([-2.8], [9.5, 1], 1.8), ([4.3], [9.2, 1], 0.35)]]
    ), {}  # fmt: skip


def parallel():
    """Like units: shares of the range of a that integral action permits."""
    for n in (2, 3, 4):
        for share in (-0.95, -0.5, 0.5, 0.95):
            a = share if share > 0 else share / (n - 1)
            for ratio in (10, 100):
                yield f"parallel n {n} share {share} ratio {ratio}", "family", {
                    "kind": "first_order", "n": n, "gain": 1, "time_constant": ratio,
                    "interaction": a,
                }, {"kinds": ("PI",) if n == 4 else ("PI", "PID")}  # fmt: skip
    for other in (0, 30):
        yield f"late interaction {other}", "family", {
            "kind": "parallel", "n": 2, "process": element([1], [50, 1], 0.5),
            "interaction": element([0.5], [50, 1], other),
        }, {}  # fmt: skip
    # Hundreds of turns of the phase below the crossover: samples that are not aligned with the
    # turns, even eight a turn, show 2.197 for settings whose tau_P is 2.95.
    yield "late interaction, many turns", "family", {
        "kind": "parallel", "n": 2, "process": element([1], [1000, 1]),
        "interaction": element([0.5], [1000, 1], 100),
    }, {}  # fmt: skip


def integrating():
    """Elements with a pole at 0."""
    for dead_time in (0, 1, 5):
        yield f"integrator dead time {dead_time}", "family", {
            "kind": "parallel", "n": 1, "process": element([1], [1, 0], dead_time),
            "interaction": NONE,
        }, {}  # fmt: skip
    for a in (-0.5, 0.5, 0.99):
        yield f"integrating pair {a}", "family", {
            "kind": "parallel", "n": 2, "process": element([1], [1, 0]),
            "interaction": element([a], [1, 0]),
        }, {}  # fmt: skip


def single():
    """One loop: dead time, inverse response, lags, lightly damped, little uncertainty."""
    for name, process in {
        "dead time 10": element([1], [10, 1], 10),
        "pure dead time": element([1], [1], 5),
        "inverse response": element([-3, 1], [100, 20, 1]),
        "three lags": element([1], [1, 3, 3, 1]),
        "five lags": element([1], np.poly([-1] * 5).tolist()),
        "damping 0.1": element([1], [25, 1, 1]),
        "damping 0.02": element([1], [25, 0.2, 1]),
        "fast and slow": element([1], np.polymul([1000, 1], [0.01, 1]).tolist()),
    }.items():
        plant = {"kind": "parallel", "n": 1, "process": process, "interaction": NONE}
        yield name, "family", plant, {}
    lags = {"kind": "parallel", "n": 1, "process": element([1], [1, 3, 3, 1]), "interaction": NONE}
    yield (
        "three lags, little error",
        "family",
        lags,
        {"uncertainty": {"epsilon": 0.1, "theta": 0.03}},
    )
    lag = {"kind": "first_order", "n": 1, "gain": 1, "time_constant": 100, "interaction": 0,
           "dead_time": 1}  # fmt: skip
    for peak in (1.015, 1.1):
        yield f"max_peak {peak}", "family", lag, {"performance": {"max_peak": peak}}


def scaled():
    """Wood and Berry's column in other units of inputs and time."""
    for size in (1e-6, 1e6):
        for time in (1e-6, 1e6):
            yield f"units {size:g} {time:g}", "Wood and Berry 1973, other units", matrix(
                [[([12.8 * size], [16.7 * time, 1], time),
                  ([-18.9], [21 * time, 1], 3 * time)],
                 [([6.6 * size], [10.9 * time, 1], 7 * time),
                  ([-19.4], [14.4 * time, 1], 3 * time)]]
            ), {"kinds": ("PI",), "uncertainty": {"epsilon": 0.2, "theta": time}}  # fmt: skip


def matrices():
    """Random plants of two to six units, diagonally strong, some with dead time."""
    rng = np.random.default_rng(5)
    for n in (2, 2, 2, 3, 3, 4, 5, 6):
        gain = np.eye(n) + rng.uniform(-0.6, 0.6, (n, n)) * (1 - np.eye(n)) / (n - 1) ** 0.5
        lag = rng.uniform(5, 50, (n, n))
        late = rng.choice([0.0, 1.0, 2.0], (n, n))
        name = f"matrix {n} x {n}, {gain[0, 1]:.3f}"
        yield name, "family", matrix(
            [[([round(gain[i, j], 4)], [round(lag[i, j], 3), 1], late[i, j]) for j in range(n)]
             for i in range(n)]
        ), {"kinds": ("PI", "PID") if n < 4 else ("PI",)}  # fmt: skip
