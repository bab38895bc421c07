"""The HTTP service."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from importlib.metadata import version
from typing import Any

from fastapi import FastAPI

import service.openapi
from service import answers, docs_page
from service.analyses import Analyses
from service.jobs import database
from service.jobs.dispatcher import Dispatcher
from service.jobs.engine import Engine
from service.jobs.store import Store
from service.jobs.watch import Watcher
from service.metrics import Metrics
from service.middleware import Observed, SecurityHeaders
from service.routes import health, robustness, tunings
from service.settings import Settings

__all__ = ["create_app"]

_DESCRIPTION = """
Robust PI/PID settings for identical parallel units: provably as fast as the model uncertainty
permits. Times are in one unit of the caller's choice, frequencies in radians per that unit.
Errors are RFC 9457 problems that name faulty values by JSON pointer.
"""

_TAGS = [
    {"name": "tunings", "description": "Find loop settings: jobs with progress and result."},
    {"name": "analyses", "description": "Answers within the request."},
    {"name": "operations", "description": "For whoever runs the service."},
]


def create_app(settings: Settings | None = None) -> FastAPI:
    """Return the service as an ASGI app.

    Parameters
    ----------
    settings : Settings or None
        None: from the environment.

    """
    app = FastAPI(
        title="mutune",
        version=version("mutune"),
        summary="Robust tuning of decentralised PI and PID loops",
        description=_DESCRIPTION,
        license_info={"name": "MIT", "identifier": "MIT"},
        openapi_tags=_TAGS,
        docs_url=None,
        redoc_url=None,
        lifespan=_lifespan,
    )
    app.state.settings = settings or Settings()
    app.state.metrics = Metrics()
    answers.install(app)
    for module in (tunings, robustness, health):
        app.include_router(module.router)
    docs_page.install(app)

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = service.openapi.document(app)
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]  # FastAPI's way to extend the document
    app.add_middleware(SecurityHeaders)
    app.add_middleware(Observed, metrics=app.state.metrics)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    settings: Settings = app.state.settings
    async with AsyncExitStack() as stack:
        stack.enter_context(database.sole_user(settings.url))
        connections = database.connect(settings.url)
        stack.callback(connections.dispose)
        await asyncio.to_thread(database.migrate, connections)

        store = app.state.store = Store(connections)
        watcher = app.state.watcher = Watcher(store)
        app.state.analyses = Analyses(settings.analysis_processes, settings.analysis_time_limit)
        stack.push_async_callback(app.state.analyses.close)

        def wake() -> None:
            app.state.dispatcher.wake()

        engine = app.state.engine = Engine(settings.scheduler, settings.workers, wake)
        app.state.dispatcher = Dispatcher(store, engine, settings.max_attempts, watcher.poke)
        await engine.start()
        stack.push_async_callback(engine.close)
        for work in (watcher.run, app.state.dispatcher.run):
            await stack.enter_async_context(_background(work()))
        yield


@asynccontextmanager
async def _background(work: Any) -> AsyncIterator[None]:  # noqa: ANN401 - a coroutine
    """Run `work` beside the body, and stop it at the end."""
    task = asyncio.create_task(work)
    try:
        yield
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
