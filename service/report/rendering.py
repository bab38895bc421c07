"""HTML made from the templates of `service/templates`: every value in it is escaped."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from service.report import mathml
from service.wording import number, unit_of

__all__ = ["render", "source"]


def render(template: str, **values: object) -> str:
    """Return the template of this name, filled in."""
    return _environment().get_template(template).render(**values)


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
    environment.filters["number"] = number
    environment.filters["unit_of"] = unit_of
    environment.filters["mathml"] = mathml.transfer_function
    environment.globals["zip"] = zip
    return environment
