"""A real browser on a real service."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Generator, Iterator

import network
import pytest
from playwright.sync_api import Browser, BrowserContext, expect, sync_playwright
from running import Service
from watching import PATIENCE, ROOT, Watched

_CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
_AXE = ROOT / "build" / "node" / "node_modules" / "axe-core"
expect.set_options(timeout=PATIENCE)
_ARGUMENTS = [
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium of the system; no longer than a module, since its event loop runs meanwhile."""
    if _CHROMIUM is None:
        pytest.skip("no chromium")
    if not _AXE.is_dir():
        pytest.skip("no axe-core in build/node: scripts/test fetches it where npm is there")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=_CHROMIUM, args=_ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """Return a service that most tests share."""
    service = Service(tmp_path_factory.mktemp("service"))
    service.start()
    yield service
    service.stop()


@pytest.fixture(autouse=True)
def still_network() -> Iterator[None]:
    """Keep other tests from adding interfaces meanwhile."""
    with network.unchanged():
        yield


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """Return a browser that knows nothing yet."""
    context = browser.new_context(
        viewport={"width": 1280, "height": 900},
        permissions=["clipboard-read", "clipboard-write"],
        reduced_motion="reduce",
    )
    yield context
    context.close()


@pytest.fixture
def watch(context: BrowserContext) -> Iterator[Callable[[Service], Watched]]:
    """Return a function that opens pages, all of which must have been quiet at the end."""
    opened: list[Watched] = []

    def open_page(service: Service) -> Watched:
        opened.append(Watched(context, service.url))
        return opened[-1]

    yield open_page
    for watched in opened:
        watched.assert_quiet()


@pytest.fixture
def watched(watch: Callable[[Service], Watched], service: Service) -> Watched:
    """Return a page of the shared service."""
    return watch(service)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Function,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Print what the service said where a test has failed."""
    report = yield
    if report.failed:
        for service in item.funcargs.values():
            if isinstance(service, Service) and service.log.exists():
                report.sections.append(("service", service.log.read_text()[-4_000:]))
    return report
