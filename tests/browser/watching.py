"""A browser's page that tolerates nothing: no console error, no foreign host, no barrier."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import urlsplit

from playwright.sync_api import BrowserContext, ConsoleMessage, Page, Request, expect

__all__ = ["PATIENCE", "ROOT", "SCREENSHOTS", "Watched"]

ROOT = Path(__file__).parents[2]
SCREENSHOTS = ROOT / "build" / "screenshots"
_AXE = ROOT / "build" / "node" / "node_modules" / "axe-core" / "axe.min.js"
_PHONE = {"width": 360, "height": 740}
PATIENCE = 300_000  # milliseconds; a tuning takes two seconds, only a failure as long as this
_DESK = {"width": 1280, "height": 900}


class Watched:
    """A page of a browser, with everything that it complained about.

    Parameters
    ----------
    context : BrowserContext
        The browser's, whose storage the pages share.
    url : str
        Address of the service.

    """

    def __init__(self, context: BrowserContext, url: str) -> None:
        self.url = url
        self.page: Page = context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._permitted: list[str] = []
        self.page.on("console", self._heard)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", self._asked)

    def _heard(self, message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"}:
            self.complaints.append(message.text)

    def _asked(self, request: Request) -> None:
        self.requests.append(request.url)
        parts = urlsplit(request.url)
        if parts.scheme not in {"data", "blob"} and not request.url.startswith(self.url):
            self.complaints.append(f"request to {request.url}")

    def permit(self, text: str) -> None:
        """Expect complaints with this text, which the test provokes."""
        self._permitted.append(text)

    def assert_quiet(self) -> None:
        """Check that nothing unexpected was heard."""
        unexpected = [
            text for text in self.complaints if not any(part in text for part in self._permitted)
        ]
        assert not unexpected, unexpected

    def go(self, place: str) -> None:
        """Open a view and wait until it stands there."""
        self.page.goto(f"{self.url}/{place}")
        self.page.wait_for_selector("main:not([aria-busy]) h1")

    def wait_for_figures(self) -> None:
        """Wait until figures have been asked for, and all are drawn."""
        expect(self.page.locator("figure svg.main-svg").first).to_be_visible()
        expect(self.page.locator("[aria-busy]")).to_have_count(0)
        expect(self.page.locator("figure:not(:has(svg.main-svg))")).to_have_count(0)

    def open_evidence(self) -> None:
        """Unfold the curves, optima and forms below a result, and wait until they stand there."""
        self.page.get_by_text("Evidence: peaks").click()
        self.wait_for_figures()

    def inspect(self, name: str) -> None:
        """Check a view for barriers, wide in light, narrow in dark; keep a picture of a fault."""
        for scheme, shape, size in (("light", "wide", _DESK), ("dark", "phone", _PHONE)):
            self.page.set_viewport_size(size)
            self.page.emulate_media(color_scheme=scheme)
            try:
                self._assert_fits(name)
                self._assert_accessible(f"{name}, {scheme}")
            except AssertionError:
                self.page.screenshot(path=SCREENSHOTS / f"{name}-{shape}.png", full_page=True)
                raise
        self.page.set_viewport_size(_DESK)
        self.page.emulate_media(color_scheme="light")

    def _assert_fits(self, name: str) -> None:
        wide = self.page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, f"{name} is {wide} px too wide"

    def _assert_accessible(self, name: str) -> None:
        if not self.page.evaluate("'axe' in window"):
            self.page.evaluate(_AXE.read_text(encoding="utf-8"))
        only = "{resultTypes: ['violations']}"  # what is in order needs no words
        found = self.page.evaluate(f"axe.run({only}).then(result => result.violations)")
        told = [
            f"{violation['id']}: {violation['help']}: {node['html'][:200]} {node['any'][:1]}"
            for violation in found
            for node in violation["nodes"]
        ]
        assert not told, (name, told)
