"""Long arrays, item by item."""

import asyncio
import json
from collections.abc import AsyncIterator

from hypothesis import given, settings
from hypothesis import strategies as st

from service.http.json_stream import ArrayReader

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=5,
)


@given(items=st.lists(JSON, max_size=5), size=st.integers(1, 40), indent=st.sampled_from([None, 1]))
@settings(deadline=None, max_examples=60)
def test_items_are_those_of_the_array(items: list[object], size: int, indent: int | None) -> None:
    """However the text is cut into chunks, the items are those that JSON knows."""
    text = json.dumps({"items": items}, indent=indent).encode()

    async def chunks() -> AsyncIterator[bytes]:
        for start in range(0, len(text), size):
            yield text[start : start + size]

    async def read() -> list[object]:
        return [json.loads(item) async for item in ArrayReader("items", 10_000).items(chunks())]

    assert asyncio.run(read()) == items
