"""Hooks of the documentation site: generated reference pages, links that leave docs/, equations as MathML.

MkDocs calls `on_config`, `on_files` and `on_page_markdown` while it builds (`make docs`).
"""

import inspect
import logging
import os
import re
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import abs_client
from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import abs_service
from abs_service import cli

ROOT = Path(__file__).parents[1]
LINK = re.compile(r"(?P<text>\[[^\]\[]*\])\((?P<path>[^)\s#:]+)(?P<anchor>#[^)\s]*)?\)")
#: Folder of the site with the files outside docs/ that a page links to.
SOURCE = "source"
#: Pages of the repository outside docs/ whose links are checked even if no page links to them.
PAGES = ("README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "CONVENTIONS.md", "evaluation/README.md")
INLINE = re.compile(r"\$`([^`]+)`\$")
LOG = logging.getLogger("mkdocs.hooks")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Equations in GitHub's notation, blocks of ```math and $`…`$ in a line, become MathML, which needs no script."""
    fences = config.mdx_configs.setdefault("pymdownx.superfences", {}).setdefault("custom_fences", [])
    fences.append({"name": "math", "class": "math", "format": _equation})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the generated pages and the files outside docs/ that pages link to."""
    for path, text in (
        ("reference/commands.md", _commands()),
        ("reference/messages.md", _messages()),
        ("reference/classes.md", _classes()),
        ("reference/client-names.md", _client_names()),
        ("decisions/index.md", _decisions()),
    ):
        files.append(File.generated(config, path, content=text))
    pending = [ROOT / path for path in PAGES]
    pending += [ROOT / "docs" / page.src_uri for page in files.documentation_pages()]
    added = {ROOT / path for path in PAGES}
    for path in added:
        _add(path, files, config)
    while pending:
        page = pending.pop()
        if page.suffix != ".md" or not page.exists():
            continue
        for target in _targets(page):
            if (
                target.is_file()
                and ROOT in target.parents
                and ROOT / "docs" not in target.parents
                and target not in added
            ):
                added.add(target)
                pending.append(target)
                _add(target, files, config)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links are turned from places in the repository to places in the site; a link to a folder becomes its text."""
    markdown = INLINE.sub(lambda formula: f"<span>{convert(formula[1])}</span>", markdown)
    origin = page.file.abs_src_path
    if origin is None:  # generated
        return markdown
    folder = Path(origin).parent
    place = os.path.dirname(page.file.src_uri)

    def moved(link: re.Match[str]) -> str:
        target = Path(os.path.normpath(folder / link["path"]))
        if target.is_dir():
            return link["text"][1:-1]
        if not target.exists() and not files.get_file_from_path(os.path.normpath(os.path.join(place, link["path"]))):
            LOG.warning("%s links to %s, which is not there", origin, link["path"])
        return f"{link['text']}({os.path.relpath(_in_site(target), place or '.')}{link['anchor'] or ''})"

    return LINK.sub(moved, markdown)


def _in_site(path: Path) -> str:
    docs = ROOT / "docs"
    return (
        path.relative_to(docs).as_posix() if docs in path.parents else f"{SOURCE}/{path.relative_to(ROOT).as_posix()}"
    )


def _add(path: Path, files: Files, config: MkDocsConfig) -> None:
    files.append(File.generated(config, _in_site(path), abs_src_path=str(path)))


def _targets(page: Path) -> Iterator[Path]:
    for link in LINK.finditer(page.read_text(encoding="utf-8")):
        yield Path(os.path.normpath(page.parent / link["path"]))


def _equation(source: str, language: str, css_class: str, options: Any, md: Any, **others: Any) -> str:
    return f'<div class="{css_class}">{convert(source, display="block")}</div>'


def _commands() -> str:
    """The help of every command, as its parser prints it."""
    return "# Commands\n\n" + "\n\n".join(_help("", cli.COMMANDS, "abs_service.commands"))


def _help(name: str, commands: Mapping[str, str], package: str) -> Iterator[str]:
    os.environ["COLUMNS"] = "100"
    for command in commands:
        full = f"{name} {command}".strip()
        module = import_module(f"{package}.{cli.MODULES.get(full, command)}")
        if below := getattr(module, "COMMANDS", None):
            yield from _help(full, below, module.__name__)
        else:
            yield f"## {full}\n\n```text\n{cli.command_parser(full, module).format_help()}```"


def _messages() -> str:
    """The message definitions, comments included."""
    parts = [
        "# Messages",
        "Every field, from `proto/absmsg/v1`. [Subscribing](../how-to/subscribing.md) says which key carries which.",
    ]
    for path in sorted((ROOT / "proto/absmsg/v1").glob("*.proto")):
        body = path.read_text(encoding="utf-8").split("\n\n", 1)[1]
        parts.append(f"## {path.name}\n\n```proto\n{body}```")
    return "\n\n".join(parts)


def _classes() -> str:
    """One mkdocstrings directive for each public name."""
    parts = ["# Every public name", "What [Python](api.md) describes in examples, from the docstrings."]
    parts += [*_public(abs_service), *_public(abs_service.noise, "noise.")]
    return "\n\n".join(parts)


def _client_names() -> str:
    parts = ["# Every public name of the client", "What [its page](../how-to/client.md) describes in examples."]
    return "\n\n".join([*parts, *_public(abs_client)])


def _public(package: ModuleType, prefix: str = "") -> Iterator[str]:
    for name in package.__all__:
        of = getattr(package, name)
        if not inspect.ismodule(of):
            options = f"    options:\n      heading: {prefix}{name}\n      toc_label: {prefix}{name}"
            yield f"::: {of.__module__}.{of.__qualname__}\n{options}"


def _decisions() -> str:
    pages = sorted((ROOT / "docs/decisions").glob("[0-9]*.md"))[1:]
    titles = (page.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ") for page in pages)
    return "# Decisions\n\n" + "\n".join(f"- [{title}]({page.name})" for title, page in zip(titles, pages))
