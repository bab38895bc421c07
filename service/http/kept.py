"""Answers that were computed from a finished job and are asked for again, within bounds.

A request and its result do not change once a job has ended, and a sheet takes seconds: whoever
comes back to it, compares it or opens it in a second tab gets what was computed before.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict

__all__ = ["Kept", "key_of"]

ROOM = 32_000_000  # bytes of all: some fifty sheets with their figures
_LARGEST = ROOM // 8  # bytes of one, lest it drive out all others


class Kept:
    """Answers by what they were computed from; those asked for last stay longest.

    Parameters
    ----------
    room : int
        Bytes of all together.

    """

    def __init__(self, room: int = ROOM) -> None:
        self._room = room
        self._held = 0
        self._answers: OrderedDict[bytes, bytes] = OrderedDict()

    def get(self, key: bytes) -> bytes | None:
        """Return the answer, if it is there."""
        found = self._answers.get(key)
        if found is not None:
            self._answers.move_to_end(key)
        return found

    def keep(self, key: bytes, answer: bytes) -> None:
        """Keep an answer, and forget those that were not asked for longest."""
        if len(answer) > min(self._room, _LARGEST) or key in self._answers:
            return
        self._answers[key] = answer
        self._held += len(answer)
        while self._held > self._room:
            self._held -= len(self._answers.popitem(last=False)[1])


def key_of(*texts: str) -> bytes:
    """Return a digest of texts, in which each keeps its place."""
    digest = hashlib.blake2b(digest_size=32)
    for text in texts:
        digest.update(hashlib.blake2b(text.encode()).digest())
    return digest.digest()
