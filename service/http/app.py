"""The HTTP service."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

from fastapi import Depends, FastAPI
from fastapi.middleware.cors import CORSMiddleware
from fastapi.routing import APIRoute
from sqlalchemy import Engine as Connections

from service.audit import Trail
from service.configuration import Configuration
from service.http import docs_page, errors
from service.http.access import RateLimiter, authenticate
from service.http.description import document
from service.http.guards import Head, KnownHosts, PlainHeads, SteadyBodies
from service.http.kept import Kept
from service.http.metrics import RequestMetrics
from service.http.middleware import Compressed, Observed, SecurityHeaders
from service.http.notices import notify
from service.http.routes import (
    analyses,
    batch_results,
    batches,
    controllers,
    examples,
    figures,
    health,
    page,
    records,
    tables,
    tunings,
    well_known,
)
from service.http.routes.common import problems
from service.jobs import database, encryption
from service.jobs.callbacks import Callbacks
from service.jobs.dispatcher import Dispatcher
from service.jobs.engine import Engine
from service.jobs.leadership import lead
from service.jobs.pool import Pool
from service.jobs.queue import Queue
from service.jobs.retention import expire
from service.jobs.store import Store
from service.jobs.transactions import Transactions
from service.jobs.watch import Watcher
from service.keys import KeyFile
from solver import __version__

__all__ = ["create_app"]

_RETRY = 1.0  # seconds between tries to reach a database

logger = logging.getLogger(__name__)

_DESCRIPTION = """
Robust PI/PID settings for identical parallel units: provably as fast as the model uncertainty
permits. Times are in one unit of the caller's choice, frequencies in radians per that unit.
Errors are RFC 9457 problems that name faulty values by JSON pointer.
"""

_TAGS = [
    {"name": "tunings", "description": "Find loop settings: jobs with progress and result."},
    {"name": "analyses", "description": "Answers within the request."},
    {"name": "records", "description": "Files of plant data."},
    {"name": "controllers", "description": "What settings can be typed into."},
    {"name": "examples", "description": "Requests to start from."},
    {"name": "operations", "description": "For whoever runs the service."},
]

# Resources that need an API key, where the service has keys, and those that never do.
_FOR_CALLERS = (tunings, batches, batch_results, analyses, records, figures, tables)
_FOR_EVERYBODY = (controllers, examples, health, page, well_known)


def create_app(configuration: Configuration | None = None) -> FastAPI:
    """Return the service as an ASGI app.

    Parameters
    ----------
    configuration : Configuration or None
        None: from the environment.

    Raises
    ------
    pydantic.ValidationError
        A variable of the environment has a value that it cannot have.

    """
    app = FastAPI(
        title="mutune",
        version=__version__,
        summary="Robust tuning of decentralised PI and PID loops",
        description=_DESCRIPTION,
        license_info={"name": "MIT", "identifier": "MIT"},
        openapi_tags=_TAGS,
        openapi_url=None,  # see docs_page
        docs_url=None,
        redoc_url=None,
        lifespan=_lifespan,
        # Names of functions of clients that are generated: they stay when a path is put elsewhere.
        generate_unique_id_function=lambda route: route.name,
    )
    app.state.configuration = configuration or Configuration()
    app.state.metrics = RequestMetrics()
    app.state.on_their_way = 0  # bytes of long answers
    app.state.kept = Kept()
    app.state.parsing = asyncio.Semaphore(1)  # of long bodies
    errors.install(app)
    keys = app.state.configuration.api_keys_file
    app.state.keys = None if keys is None else KeyFile(keys)
    app.state.limiter = RateLimiter(app.state.configuration.requests_per_minute)
    for module in _FOR_CALLERS:
        app.include_router(
            module.router,
            dependencies=[Depends(authenticate)],
            responses=problems(401, 403, 429),
        )
    for module in _FOR_EVERYBODY:
        app.include_router(module.router)
    docs_page.install(app)
    app.state.routes = [
        route
        for module in (*_FOR_CALLERS, *_FOR_EVERYBODY)
        for route in module.router.routes
        if isinstance(route, APIRoute)
    ]

    # FastAPI's way to extend the document
    app.openapi = lambda: document(app)  # type: ignore[method-assign]
    if app.state.configuration.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=app.state.configuration.cors_origins,
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=[
                "Authorization",
                "Callback-URL",
                "Content-Type",
                "Idempotency-Key",
                "Prefer",
            ],
            expose_headers=[
                "Location",
                "RateLimit",
                "RateLimit-Policy",
                "Retry-After",
                "X-Request-Id",
            ],
        )
    app.add_middleware(Compressed)
    app.add_middleware(SteadyBodies)
    app.add_middleware(Head)
    app.add_middleware(PlainHeads)
    # Who has no key is trusted for where they come from; with keys a name may be any.
    if app.state.keys is None or app.state.configuration.allowed_hosts:
        app.add_middleware(
            KnownHosts,
            hosts=app.state.configuration.allowed_hosts,
            origins=app.state.configuration.cors_origins,
        )
    app.add_middleware(SecurityHeaders)
    trail = Trail(app.state.configuration.audit_file)
    app.add_middleware(Observed, metrics=app.state.metrics, trail=trail)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    configuration: Configuration = app.state.configuration
    async with AsyncExitStack() as stack:
        stack.enter_context(database.sole_user(configuration.url))
        connections = database.connect(configuration.url)
        stack.callback(connections.dispose)
        await _migrated(connections, configuration.start_wait)

        transactions = Transactions(connections)
        store = app.state.store = Store(transactions, configuration.max_queued)
        queue = Queue(transactions, configuration.max_running)
        watcher = app.state.watcher = Watcher(store)
        app.state.pool = Pool(
            configuration.analysis_processes,
            time_limit=configuration.analysis_time_limit,
            memory_limit=configuration.analysis_memory,
        )
        stack.push_async_callback(app.state.pool.close)

        def wake() -> None:
            app.state.dispatcher.wake()

        engine = app.state.engine = Engine(
            configuration.scheduler,
            configuration.workers,
            wake,
            encryption.for_cluster(configuration),
        )
        dispatcher = app.state.dispatcher = Dispatcher(
            queue, engine, configuration.max_attempts, watcher, app.state.metrics.observe_job
        )
        await engine.start()
        stack.push_async_callback(engine.close)
        await stack.enter_async_context(_background(watcher.run()))
        await stack.enter_async_context(_background(lead(connections, dispatcher.run)))
        await stack.enter_async_context(_background(expire(queue, configuration.retention_days)))
        if configuration.callback_urls and configuration.callback_key_file is not None:
            notices = notify(Callbacks(transactions), configuration.callback_key_file)
            await stack.enter_async_context(_background(notices))
        yield


async def _migrated(connections: Connections, patience: float) -> None:
    """Bring the schema up to date, as soon as the database answers.

    Raises
    ------
    CannotStartError
        It does not answer in `patience` seconds, or is newer than this program.

    """
    deadline = time.monotonic() + patience
    while True:
        try:
            await asyncio.to_thread(database.migrate, connections)
        except database.DatabaseSilentError as error:
            if time.monotonic() > deadline:
                raise
            logger.warning("%s; trying again", error)
            await asyncio.sleep(_RETRY)
        else:
            return


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
