"""The items of a long JSON array, one by one as they arrive, in bounded memory."""

from __future__ import annotations

import json
import re
from collections.abc import AsyncIterable, AsyncIterator

from service.schemas.parsing import Fault, RequestError

__all__ = ["ArrayReader"]

_TOKEN = re.compile(rb'"(?:[^"\\]|\\.)*"|[{}\[\],"]', re.DOTALL)


class ArrayReader:
    """Reads ``{"name": [item, item, ...]}``, beside which other members may stand.

    Parameters
    ----------
    name : str
        The one member of the object.
    largest : int
        Greatest length of an item in bytes.

    Attributes
    ----------
    others : dict
        The other members, complete once all items are read.

    """

    def __init__(self, name: str, largest: int) -> None:
        self._name = name
        self._largest = largest
        self._start = re.compile(
            rb'\s*(?P<others>\{(?:\s*"\w+"\s*:\s*"[^"\\]*"\s*,)*)\s*"' + name.encode()
            + rb'"\s*:\s*\[\s*'
        )  # fmt: skip
        self.others: dict[str, object] = {}
        self._buffer = b""

    async def items(self, chunks: AsyncIterable[bytes]) -> AsyncIterator[bytes]:
        """Yield the text of each item; whether that is JSON is for the caller to find out.

        Raises
        ------
        RequestError
            The text has another form, or an item is too long.

        """
        stream = aiter(chunks)
        await self._open(stream)
        index, is_last = 0, False
        while not is_last:
            item, is_last = await self._item(stream, index)
            if item.strip() or index or not is_last:  # nothing at all is an empty array
                yield item
            index += 1
        await self._close(stream)

    async def _open(self, stream: AsyncIterator[bytes]) -> None:
        while not (head := self._start.match(self._buffer)):
            if len(self._buffer) > self._largest or not await self._more(stream):
                detail = f'the body must be {{"{self._name}": [...]}}'
                raise RequestError((Fault("", detail),))
        self._read_others(head["others"].rstrip(b", ") + b"}")
        self._buffer = self._buffer[head.end() :]

    def _read_others(self, text: bytes) -> None:
        try:
            others = json.loads(text)
        except ValueError:
            detail = f'the body must be {{"{self._name}": [...]}}'
            raise RequestError((Fault("", detail),)) from None
        if self.others.keys() & others.keys():
            raise RequestError((Fault("", "a member is there twice"),))
        self.others |= others

    async def _item(self, stream: AsyncIterator[bytes], index: int) -> tuple[bytes, bool]:
        """Return the text up to the next comma or the end of the array, and which it was."""
        depth, position = 0, 0
        while True:
            token = _TOKEN.search(self._buffer, position)
            if token is None or token[0] == b'"':  # nothing more, or a string without its end
                position = len(self._buffer) if token is None else token.start()
                await self._need_more(stream, index)
                continue
            position = token.end()
            if depth == 0 and token[0] in (b",", b"]"):
                item = self._buffer[: token.start()]
                self._buffer = self._buffer[position:]
                return item, token[0] == b"]"
            depth += (token[0] in (b"{", b"[")) - (token[0] in (b"}", b"]"))

    async def _need_more(self, stream: AsyncIterator[bytes], index: int) -> None:
        if len(self._buffer) > self._largest:
            detail = f"an item has at most {self._largest} bytes"
            raise RequestError((Fault(f"/{self._name}/{index}", detail),))
        if not await self._more(stream):
            raise RequestError((Fault("", "the text ends within the array"),), is_json=False)

    async def _close(self, stream: AsyncIterator[bytes]) -> None:
        while len(self._buffer) <= self._largest and await self._more(stream):
            pass
        rest = self._buffer.strip()
        self._read_others(b"{" + rest[1:] if rest.startswith(b",") else b"{" + rest)

    async def _more(self, stream: AsyncIterator[bytes]) -> bool:
        chunk = await anext(stream, None)
        self._buffer += chunk or b""
        return chunk is not None
