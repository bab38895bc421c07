"""Requests that the tests of the service start from."""

from __future__ import annotations

import copy
from typing import Any

TUNING: dict[str, Any] = {
    "plant": {
        "kind": "first_order",
        "n": 2,
        "gain": 1,
        "time_constant": 100,
        "interaction": 0.949,
    },
    "uncertainty": {"epsilon": 0.2, "theta": 1},
}
# Settings and time constant: Skogestad, Lundstrom and Hovd (1989), independent PI, table 2.
ROBUSTNESS: dict[str, Any] = {
    **TUNING,
    "performance": {"tau_p": 19},
    "loops": [{"gain": 46.3, "integral_time": 101}, {"gain": 22.8, "integral_time": 3.15}],
}


def tuning(seed: int = 0, **search: float) -> dict[str, Any]:
    """Return a tuning request with these search options."""
    return {**copy.deepcopy(TUNING), "search": {"seed": seed, **search}}


def altered(request: dict[str, Any], pointer: str, value: object) -> dict[str, Any]:
    """Return the request with another value at the JSON pointer."""
    result = copy.deepcopy(request)
    *path, last = pointer.strip("/").split("/")
    target: Any = result
    for part in path:
        target = target[int(part)] if isinstance(target, list) else target.setdefault(part, {})
    if isinstance(target, list):
        target[int(last)] = value
    else:
        target[last] = value
    return result
