"""The plants of the zoo, as tuning requests: published ones with their sources, and families."""

import numpy as np

USUAL = {"epsilon": 0.2, "theta": 1}
QUOTED = ", numbers as quoted elsewhere, not compared with the paper"
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
    yield from columns()
    yield from benchmark_loops()
    yield from delayed_pairs()
    yield from many()
    yield from other_pairs()
    yield from more_matrices()
    yield from errors_and_demands()


def single_loop(process):
    """Return a plant of one loop."""
    return {"kind": "parallel", "n": 1, "process": process, "interaction": NONE}


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
    source = "Wood and Berry 1973, as in Astrom and Hagglund 2006, example 11.6"
    yield "Wood and Berry", source, matrix(
        [[([12.8], [16.7, 1], 1), ([-18.9], [21, 1], 3)],
         [([6.6], [10.9, 1], 7), ([-19.4], [14.4, 1], 3)]]
    ), {}  # fmt: skip
    yield "Vinante and Luyben", f"Vinante and Luyben 1972{QUOTED}", matrix(
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
        yield name, "family", single_loop(process), {}
    yield (
        "three lags, little error",
        "family",
        single_loop(element([1], [1, 3, 3, 1])),
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


def columns():
    """Further plants from papers: columns, a reactor, tanks."""
    some = {"uncertainty": {"epsilon": 0.2, "theta": 0.1}}
    yield "Wardle and Wood", f"Wardle and Wood 1969{QUOTED}", matrix(
        [[([0.126], [60, 1], 6), ([-0.101], np.polymul([48, 1], [45, 1]).tolist(), 12)],
         [([0.094], [38, 1], 8), ([-0.12], [35, 1], 8)]]
    ), {}  # fmt: skip
    yield "Tyreus stabilizer", f"Tyreus 1982, as in Luyben 1986{QUOTED}", matrix(
        [[([-1.153, -0.1153], np.poly([-0.25] * 3).dot(64).tolist(), 0.1),
          ([0.2429], np.polymul([33, 1], [33, 1]).tolist(), 2)],
         [([-0.0887], np.polymul([43, 1], [22, 1]).tolist(), 12.6),
          ([0.2429], np.polymul([44, 1], [20, 1]).tolist(), 0.17)]]
    ), some  # fmt: skip
    yield "polymerisation reactor", f"Chien, Huang and Yang 1999{QUOTED}", matrix(
        [[([22.89], [4.572, 1], 0.2), ([-11.64], [1.807, 1], 0.4)],
         [([4.689], [2.174, 1], 0.2), ([5.8], [1.801, 1], 0.4)]]
    ), some  # fmt: skip
    yield "four tanks, minimum phase", f"Johansson 2000, P-{QUOTED}", matrix(
        [[([2.6], [62, 1]), ([1.5], np.polymul([23, 1], [62, 1]).tolist())],
         [([1.4], np.polymul([30, 1], [90, 1]).tolist()), ([2.8], [90, 1])]]
    ), {}  # fmt: skip
    # Paired crosswise, as its relative gains ask for.
    source = f"Johansson 2000, P+, inputs interchanged{QUOTED}"
    yield "four tanks, zero on the right", source, matrix(
        [[([2.5], np.polymul([39, 1], [63, 1]).tolist()), ([1.5], [63, 1])],
         [([1.6], [91, 1]), ([2.5], np.polymul([56, 1], [91, 1]).tolist())]]
    ), {}  # fmt: skip
    yield "Ogunnaike and Ray", f"Ogunnaike and Ray 1979{QUOTED}", matrix(
        [[([0.66], [6.7, 1], 2.6), ([-0.61], [8.64, 1], 3.5), ([-0.0049], [9.06, 1], 1)],
         [([1.11], [3.25, 1], 6.5), ([-2.36], [5, 1], 3), ([-0.01], [7.09, 1], 1.2)],
         [([-34.68], [8.15, 1], 9.2), ([46.2], [10.9, 1], 9.4),
          ([10.1007, 0.87], np.polymul([3.89, 1], [18.8, 1]).tolist(), 1)]]
    ), {"kinds": ("PI",), "performance": {"max_peak": 2, "output_scale": [1, 1, 10]}}  # fmt: skip


def benchmark_loops():
    """Single loops after Astrom and Hagglund 2000, "Benchmark systems for PID control"."""
    source = f"Astrom and Hagglund 2000, test batch{QUOTED}"
    little = {"uncertainty": {"epsilon": 0.2, "theta": 0.1}}
    for n in (1, 2, 4, 8):
        yield f"lags {n}", source, single_loop(element([1], np.poly([-1] * n).tolist())), little
    for ratio in (0.1, 0.2, 0.5):
        poles = [-1 / ratio**i for i in range(4)]
        den = np.poly(poles) / np.prod(np.abs(poles))
        yield f"lags in ratio {ratio}", source, single_loop(element([1], den.tolist())), little
    for zero in (0.1, 0.5, 1, 2, 5):
        process = element([-zero, 1], [1, 3, 3, 1])
        yield f"zero on the right {zero}", source, single_loop(process), little
    for lag in (0.1, 0.5, 2, 10):
        process = element([1], np.polymul([lag, 1], [lag, 1]).tolist(), 1)
        yield f"dead time and lags {lag}", source, single_loop(process), little
    for omega in (1, 2, 5, 10):
        den = np.polymul([1, 1], [1 / omega**2, 0.2 / omega, 1])
        yield f"lag and resonance {omega}", source, single_loop(element([1], den.tolist())), little
    den = np.polymul([1, 2, 1, 0], [1 / 36, 1])
    process = element([1 / 36, 12 / 36, 1], den.tolist())
    yield "fast and slow modes", source, single_loop(process), little


def delayed_pairs():
    """Two and three like units with dead time."""
    for n, share in ((2, -0.8), (2, 0.3), (2, 0.8), (3, -0.6), (3, 0.8)):
        for late in (0.5, 5):
            a = share if share > 0 else share / (n - 1)
            yield f"late units n {n} a {a} dead time {late}", "family", {
                "kind": "first_order", "n": n, "gain": 1, "time_constant": 30,
                "interaction": a, "dead_time": late,
            }, {"kinds": ("PI", "PID") if n == 2 else ("PI",)}  # fmt: skip


def many():
    """Many like units under one setting."""
    for n in (5, 7, 10):
        for share in (-0.9, 0.5):
            a = share if share > 0 else share / (n - 1)
            yield f"many n {n} share {share}", "family", {
                "kind": "first_order", "n": n, "gain": 1, "time_constant": 100, "interaction": a,
            }, {"arrangements": ("identical",)}  # fmt: skip


def other_pairs():
    """Pairs that are integrating, underdamped, or start the wrong way; in unlike units."""
    kinds = {
        "integrating with dead time": element([1], [1, 0], 1),
        "integrating with lag": element([1], [5, 1, 0]),
        "underdamped": element([1], [100, 4, 1]),
        "inverse response": element([-4, 1], [400, 40, 1]),
        "three lags": element([1], [1000, 300, 30, 1]),
        "overshoot": element([60, 1], [400, 40, 1]),
    }
    for name, process in kinds.items():
        for a in (-0.6, 0.6):
            other = {**process, "num": (a * np.array(process["num"])).tolist()}
            yield f"pair, {name}, a {a}", "family", {
                "kind": "parallel", "n": 2, "process": process, "interaction": other,
            }, {"kinds": ("PI",)}  # fmt: skip
    for size in (1e-6, 1e6):
        for unit in (1e-6, 1e6):
            yield f"pair in units {size:g} {unit:g}", "family", {
                "kind": "first_order", "n": 2, "gain": size, "time_constant": 50 * unit,
                "interaction": 0.8,
            }, {"kinds": ("PI",), "uncertainty": {"epsilon": 0.2, "theta": unit}}  # fmt: skip


def more_matrices():
    """Random plants with second-order elements, and rows and columns in unlike units."""
    rng = np.random.default_rng(11)
    for number, n in enumerate((2,) * 9 + (3,) * 3 + (4, 5, 6)):
        gain = np.eye(n) + rng.uniform(-0.5, 0.5, (n, n)) * (1 - np.eye(n)) / (n - 1) ** 0.5
        units = 10.0 ** rng.integers(-2, 3, n)
        gain = units[:, None] * gain * 10.0 ** rng.integers(-2, 3, n)
        slow, fast = rng.uniform(10, 60, (n, n)), rng.uniform(0.5, 5, (n, n))
        late = rng.choice([0.0, 0.5, 1.5], (n, n))
        yield f"second order {n} x {n}, {number}", "family", matrix(
            [[([float(f"{gain[i, j]:.5g}")],
               np.polymul([round(slow[i, j], 2), 1], [round(fast[i, j], 2), 1]).tolist(),
               late[i, j]) for j in range(n)] for i in range(n)]
        ), {
            "kinds": ("PI", "PID") if n == 2 and number < 4 else ("PI",),
            "performance": {"max_peak": 2, "output_scale": units.tolist()},
        }  # fmt: skip


def errors_and_demands():
    """One pair under other errors and demands."""
    pair = {"kind": "first_order", "n": 2, "gain": 1, "time_constant": 100, "interaction": 0.8}
    for epsilon in (0.05, 0.4):
        for theta in (0.2, 5):
            yield f"pair, epsilon {epsilon} theta {theta}", "family", pair, {
                "uncertainty": {"epsilon": epsilon, "theta": theta}, "kinds": ("PI",),
            }  # fmt: skip
    for peak in (1.3, 3, 10):
        performance = {"max_peak": peak}
        yield f"pair, max_peak {peak}", "family", pair, {
            "performance": performance, "kinds": ("PI",),
        }  # fmt: skip
