"""What the documentation site adds to MkDocs: formulas as MathML, pages that stand elsewhere.

Browsers set MathML by themselves, so the site needs neither scripts nor fonts from elsewhere.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from typer.main import get_command
from typer.testing import CliRunner

import mutune
from service.cli.commands import app

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
from docs_fields import fields_of_requests  # noqa: E402 - hooks are no package

# What the pages link to outside docs/, and where the site has it.
ELSEWHERE = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "openapi/openapi.json": "files/openapi.json",
    "bench/asymmetry.csv": "files/asymmetry.csv",
    "examples/quickstart.ipynb": "files/quickstart.ipynb",
}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Have fences named ``math`` set as formulas."""
    fences = config.mdx_configs.setdefault("pymdownx.superfences", {})
    fences["custom_fences"] = [{"name": "math", "class": "math", "format": formula}]
    return config


def formula(source: str, *_: Any, **__: Any) -> str:  # noqa: ANN401 - the extension's form
    """Return a displayed formula as MathML."""
    return f'<div class="formula">{convert(source.strip(), display="block")}</div>'


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what stands outside docs/, and the decisions as a chapter of the navigation."""
    for source, name in ELSEWHERE.items():
        text = (ROOT / source).read_text(encoding="utf-8").replace("](docs/", "](")
        files.append(File.generated(config, name, content=text))
    decisions = sorted(Path(config.docs_dir, "decisions").glob("*.md"))
    chapter: list[Any] = [f"decisions/{path.name}" for path in decisions]
    for section in config.nav or []:
        for entry in section.get("Project", []) if isinstance(section, dict) else []:
            if isinstance(entry, dict) and "Decisions" in entry:
                entry["Decisions"] = chapter
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Point links that leave docs/ to what the site has in their place."""
    up = "../" * page.file.src_uri.count("/")
    first = f"{up}decisions/0001-record-decisions.md"
    markdown = markdown.replace("](decisions/)", f"]({first})")
    if "<!-- fields of requests -->" in markdown:
        markdown = markdown.replace("<!-- fields of requests -->", fields_of_requests())
    if "<!-- options of commands -->" in markdown:
        markdown = markdown.replace("<!-- options of commands -->", _options())
    markdown = re.sub(r"<!-- python: ([\w\s]+) -->", _python, markdown)
    for source, name in ELSEWHERE.items():
        markdown = re.sub(rf"\]\((\.\./)+{re.escape(source)}\)", f"]({up}{name})", markdown)
    return markdown


def _python(names: re.Match[str]) -> str:
    """Return the directives that describe names of `mutune`, from where they are defined."""
    homes = mutune._HOME  # noqa: SLF001 - where each name comes from is known there alone
    return "\n\n".join(f"::: {homes[name]}.{name}" for name in names[1].split())


def _options() -> str:
    """Return what each command says of itself when asked for help."""
    commands = get_command(app).commands  # type: ignore[attr-defined] - a group of commands
    texts = {name: CliRunner().invoke(app, [name, "--help"]).stdout for name in commands}
    return "\n".join(
        f"**{name}**\n\n```text\n{text.strip()}\n```\n" for name, text in texts.items()
    )
