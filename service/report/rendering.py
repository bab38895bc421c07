"""HTML made from the templates of `service/templates`: every value in it is escaped."""

from __future__ import annotations

import math
from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from service.report import mathml

__all__ = ["digits", "render", "source"]


def render(template: str, **values: object) -> str:
    """Return the template of this name, filled in."""
    return _environment().get_template(template).render(**values)


def digits(value: float | None, count: int = 5) -> str:
    """Return `value` with `count` digits, a dash for none, and a sign for infinity."""
    if value is None:
        return "-"
    return f"{value:.{count}g}" if math.isfinite(value) else "∞"


def source(name: str) -> Markup:
    """Return a file beside the templates as it is."""
    text = (files("service") / "templates" / name).read_text("utf-8")
    return Markup(text)  # noqa: S704 - our own file


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("service"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["digits"] = digits
    environment.filters["mathml"] = mathml.transfer_function
    environment.globals["zip"] = zip
    return environment
