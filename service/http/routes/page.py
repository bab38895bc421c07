"""The page at ``/``: the files of ``service/static``, and Plotly's script from its package.

Every file but the page itself has a URL that names its content, so browsers keep it for ever
and never run a mixture of two versions.
"""

from __future__ import annotations

import hashlib
import re
from importlib.metadata import version
from importlib.resources import files
from importlib.resources.abc import Traversable

from fastapi import APIRouter, Response
from fastapi.responses import FileResponse, HTMLResponse

from service.problems import NotFoundError

__all__ = ["router"]

router = APIRouter(include_in_schema=False)

_KINDS = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_FOR_EVER = {"Cache-Control": "public, max-age=31536000, immutable"}
_PLOTLY = f"/assets/plotly-{version('plotly')}.js"


def _contents(folder: Traversable) -> dict[str, str]:
    """Return the files of the page by name."""
    items = sorted(folder.iterdir(), key=lambda item: item.name)
    return {item.name: item.read_text("utf-8") for item in items if item.is_file()}


_FILES = _contents(files("service") / "static")
_DIGEST = hashlib.sha256(repr(_FILES).encode()).hexdigest()[:16]
_ASSETS = f"/assets/{_DIGEST}"
_IMPORTED = re.compile(r'^import .* from "\./(.+)";$', re.MULTILINE)


def _first_modules() -> set[str]:
    """Return the modules of the first view: what `main.js` imports, and that in turn.

    Those of other views are imported by calls, when such a view is shown.
    """
    found: set[str] = set()
    waiting = {"main.js"}
    while waiting:
        found |= waiting
        imported = {name for file in waiting for name in _IMPORTED.findall(_FILES[file])}
        waiting = imported - found
    return found


def _page() -> str:
    """Return the page with the URLs of its files; modules load at once, not one after another."""
    modules = sorted(_first_modules())
    preload = "\n".join(f'<link rel="modulepreload" href="{_ASSETS}/{name}">' for name in modules)
    page = _FILES["index.html"].replace("<!-- modules -->", preload)
    return page.replace("{assets}", _ASSETS).replace("{plotly}", _PLOTLY)


_PAGE = _page()


@router.get("/")
async def page() -> Response:
    """Return the page."""
    return HTMLResponse(_PAGE, headers={"Cache-Control": "no-cache"})


@router.get("/favicon.ico")
async def icon() -> Response:
    """Return the icon to browsers that ask by its old name, as they do on pages without a link."""
    return Response(_FILES["icon.svg"], media_type=_KINDS[".svg"])


@router.get(_PLOTLY)
async def plotly() -> Response:
    """Return Plotly's script."""
    path = files("plotly") / "package_data" / "plotly.min.js"
    return FileResponse(str(path), media_type="text/javascript", headers=_FOR_EVER)


@router.get(f"{_ASSETS}/{{name}}")
async def asset(name: str) -> Response:
    """Return a file of the page."""
    suffix = f".{name.rpartition('.')[2]}"
    if name not in _FILES or suffix not in _KINDS:
        message = f"The page has no file {name}."
        raise NotFoundError(message)
    return Response(_FILES[name], media_type=_KINDS[suffix], headers=_FOR_EVER)
