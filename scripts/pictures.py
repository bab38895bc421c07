"""Photograph the page and a figure of the worked example for the README, from a live run.

Called by ``scripts/pictures``; writes WebP files to ``docs/images``, and what the notebook shows.
"""

from __future__ import annotations

import base64
import json
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path

from notebook_outputs import keep_outputs
from playwright.sync_api import Browser, Page, sync_playwright
from tour import EXAMPLE, HOST, ROOT, console, free_port, serving

from service.client import Client

IMAGES = ROOT / "docs" / "images"
LARGEST = 150_000  # bytes; what a reader of the README should have to load at most
QUALITY = 70  # of WebP: lines stay sharp
SCALE = 1.5  # pixels of the picture over those of the page
WIDTH, HEIGHT = 1180, 1385


def main() -> int:
    """Take the pictures; return the exit code."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        console.print("This needs Chromium.")
        return 1
    IMAGES.mkdir(exist_ok=True)
    port = free_port()
    url = f"http://{HOST}:{port}"
    with serving(url, port), sync_playwright() as playwright:
        with Client(url) as client:
            job = client.submit(json.loads(EXAMPLE.read_text()))
            client.wait(job.id)
        browser = playwright.chromium.launch(executable_path=chromium)
        photograph_page(browser, f"{url}/#/tunings/{job.id}?unit=min")
        photograph_figure(browser, f"{url}/v1/tunings/{job.id}/report?unit=min")
        keep_outputs(browser)
        browser.close()
    sizes = {path.name: path.stat().st_size for path in sorted(IMAGES.glob("*.webp"))}
    for name, size in sizes.items():
        console.print(f"docs/images/{name}: {size / 1000:.0f} kB")
    return 0 if max(sizes.values()) <= LARGEST else 1


def photograph_page(browser: Browser, url: str) -> None:
    """Take the result as the page shows it, from the top."""
    page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
    page.goto(url)
    page.locator("g.trace").first.wait_for(timeout=60_000)
    page.wait_for_load_state("networkidle")
    save(page, IMAGES / "page.webp", {"x": 0, "y": 0, "width": WIDTH, "height": HEIGHT})


def photograph_figure(browser: Browser, url: str) -> None:
    """Take mu over frequency from the report."""
    page = browser.new_page(viewport={"width": 860, "height": 900})
    # The report is a download; its text is the page.
    page.set_content(page.request.get(url).text())
    figure = page.locator("#figure-mu")
    figure.locator("g.trace").first.wait_for()
    box = figure.evaluate("(element) => element.getBoundingClientRect().toJSON()")
    save(page, IMAGES / "robustness.webp", box)


def save(page: Page, path: Path, part: Mapping[str, float]) -> None:
    """Write a part of a page, given in its pixels, as WebP."""
    clip = {side: part[side] for side in ("x", "y", "width", "height")} | {"scale": SCALE}
    options = {"format": "webp", "quality": QUALITY, "clip": clip, "captureBeyondViewport": True}
    # Playwright itself writes PNG and JPEG only.
    answer = page.context.new_cdp_session(page).send("Page.captureScreenshot", options)
    path.write_bytes(base64.b64decode(answer["data"]))


if __name__ == "__main__":
    sys.exit(main())
