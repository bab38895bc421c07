"""Results of a batch: lines of JSON as they come, or a table at the end."""

from __future__ import annotations

import asyncio
import io
import json
from collections.abc import AsyncIterator
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Header, Query, Request, Response
from fastapi.responses import StreamingResponse

from service.batch.formats import Rows, SettingsForm
from service.batch.request_lines import Item
from service.batch.table import Table, write_csv
from service.http import bodies
from service.http.routes.batches import BatchId, find_batch
from service.http.routes.common import problems
from service.jobs.records import FINAL, BatchItem
from service.jobs.store import Store
from service.schemas.batches import BatchLine, item_to_json

__all__ = ["router"]

router = APIRouter(prefix="/v1/batches", tags=["tunings"])

_LOOK = 0.5  # seconds between looks at what has ended out of turn
_PAGE = 100  # items read from the database at once

_CSV = "text/csv"


@router.get(
    "/{batch_id}/results",
    summary="Results of a batch",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "A line of JSON for each tuning, in order, as they come: "
            '`{"index": 0, "id": ..., "result": {...}}` or with "error" for "result". With '
            "`Accept: text/csv` a table once all have ended: the fields of the requests that "
            "differ, what was found, the settings.",
            "content": {
                **bodies.described_lines(BatchLine),
                _CSV: {"schema": {"type": "string"}},
            },
        },
        **problems(404, 422, 503),
    },
)
async def get_results(
    request: Request,
    batch_id: BatchId,
    *,
    start: Annotated[
        int, Query(ge=0, lt=2**31, description="Index of the first line.", examples=[0])
    ] = 0,
    order: Annotated[
        Literal["index", "completion"],
        Query(description="completion: each as soon as it is there.", examples=["completion"]),
    ] = "index",
    curves: Annotated[
        bool,
        Query(
            description="Whether results keep their curves over frequency, most of their size.",
            examples=[False],
        ),
    ] = True,
    rows: Annotated[
        Rows, Query(description="What a row of the table stands for.", examples=["loop"])
    ] = Rows.REQUEST,
    form: Annotated[
        SettingsForm, Query(description="Form of the settings in the table.", examples=["ideal"])
    ] = SettingsForm.CASCADE,
    accept: Annotated[str | None, Header(include_in_schema=False)] = None,
) -> Response:
    """Stream the results in order, waiting for those that are not there yet."""
    await find_batch(request, batch_id)
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no", "Vary": "Accept"}
    if _CSV in (accept or ""):
        headers["Content-Disposition"] = f'attachment; filename="mutune-{batch_id[:8]}.csv"'
        table = _table(request, batch_id, start, rows, form)
        return StreamingResponse(table, media_type=_CSV, headers=headers)
    stream = _in_order if order == "index" else _as_they_come
    lines = _lines(stream(request, batch_id, start), curves=curves)
    return StreamingResponse(lines, media_type=bodies.NDJSON, headers=headers)


async def _lines(pages: AsyncIterator[list[BatchItem]], *, curves: bool) -> AsyncIterator[str]:
    def text(items: list[BatchItem]) -> str:
        return "".join(item_to_json(item, curves=curves) for item in items)

    async for page in pages:
        yield await asyncio.to_thread(text, page)  # each is parsed where curves are left out


async def _in_order(request: Request, batch_id: str, start: int) -> AsyncIterator[list[BatchItem]]:
    """Yield ended items in order; wait for the first that has not ended."""
    state = request.app.state
    while not state.watcher.closed:
        items = await asyncio.to_thread(state.store.batch_items, batch_id, start, _PAGE)
        if not items:
            return
        ended = []
        for item in items:
            if item.outcome.status not in FINAL:
                break
            ended.append(item)
        if ended:
            yield ended
            start += len(ended)
        else:
            await state.watcher.wait(items[0].job_id, state.configuration.max_wait)


async def _as_they_come(
    request: Request, batch_id: str, start: int
) -> AsyncIterator[list[BatchItem]]:
    """Yield what has ended; look again for the rest, which is kept by position alone."""
    state = request.app.state
    waiting: set[int] | None = None
    while waiting is None or waiting:
        left: set[int] = set()
        position, end = (start, None) if waiting is None else (min(waiting), max(waiting))
        last = ""
        while end is None or position <= end:
            items = await asyncio.to_thread(state.store.batch_items, batch_id, position, _PAGE)
            if not items:
                break
            new = [item for item in items if waiting is None or item.position in waiting]
            ended = [item for item in new if item.outcome.status in FINAL]
            if ended:
                yield ended
            for item in new:
                if item.outcome.status not in FINAL:
                    left.add(item.position)
                    last = item.job_id
            position = items[-1].position + 1
        waiting = left
        if state.watcher.closed:
            return
        if waiting:
            await state.watcher.wait(last, _LOOK)


async def _table(
    request: Request, batch_id: str, start: int, rows: Rows, form: SettingsForm
) -> AsyncIterator[bytes]:
    """Yield the table, once every item has ended."""
    store: Store = request.app.state.store
    table = await asyncio.to_thread(_of_requests, store, batch_id, rows, form)
    found: list[dict[str, Any]] = []
    async for page in _in_order(request, batch_id, start):
        found += await asyncio.to_thread(_rows, table, page)
    if not request.app.state.watcher.closed:
        yield await asyncio.to_thread(_csv, found)


def _of_requests(store: Store, batch_id: str, rows: Rows, form: SettingsForm) -> Table:
    requests = store.batch_requests(batch_id)
    items = [Item(number, "", text) for number, text in enumerate(requests, 1)]
    return Table(items, each=rows, form=form)


def _rows(table: Table, items: list[BatchItem]) -> list[dict[str, Any]]:
    entries = (json.loads(item_to_json(item)) for item in items)
    return list(table.rows(entry | {"job": entry["id"]} for entry in entries))


def _csv(rows: list[dict[str, Any]]) -> bytes:
    file = io.BytesIO()
    write_csv(file, rows)
    return file.getvalue()
