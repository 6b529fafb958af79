"""Links inside the built pages: one to a page, a file or a place on a page that is not there fails the build.

Only what lies in the folder is looked at; nothing is fetched. This module needs no sphinx until it is an extension.
"""

from __future__ import annotations

from collections.abc import Iterable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

__all__ = ["broken", "setup"]

# pages that the theme makes: its search page has a form for what is written into it later
_MADE = ("genindex.html", "search.html", "py-modindex.html")


class _Page(HTMLParser):
    """The targets of a page, and what it points at."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.places: set[str] = set()
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        for name in ("id", "name"):
            if given.get(name):
                self.places.add(str(given[name]))
        wanted = {"a": "href", "img": "src", "source": "src"}.get(tag)
        if wanted and given.get(wanted):
            self.links.append(str(given[wanted]))


def broken(folder: Path, names: Iterable[str] | None = None) -> list[str]:
    """Every link of the pages in a folder that leads nowhere in it, as "PAGE: LINK"; links with a scheme are not looked at.

    `names` of the pages, relative to the folder; default: all that are there.
    """
    files = sorted(folder.rglob("*.html")) if names is None else [folder / name for name in sorted(names)]
    pages = {page.resolve(): _Page(page.read_text(encoding="utf-8")) for page in files if page.exists()}
    found = []
    for page, content in pages.items():
        if page.name in _MADE:
            continue
        for link in content.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            place = unquote(parts.fragment)
            is_page = target.suffix == ".html" and target.name not in _MADE
            there = target in pages if is_page else target.exists()
            if there and place and target in pages:
                there = place in pages[target].places
            if not there:
                found.append(f"{page.relative_to(folder.resolve())}: {link}")
    return found


def _check(sphinx: Any, error: Exception | None) -> None:
    if error is not None or sphinx.builder.format != "html":
        return
    from sphinx.errors import SphinxError

    # what an earlier build left of a page that is gone is neither asked nor a target
    lost = broken(Path(sphinx.outdir), {sphinx.builder.get_target_uri(name) for name in sphinx.env.found_docs})
    if lost:
        raise SphinxError("links that lead nowhere:\n  " + "\n  ".join(lost))


def setup(sphinx: Any) -> dict[str, Any]:
    """Look at the links when the pages are built."""
    sphinx.connect("build-finished", _check)
    return {"parallel_read_safe": True, "version": "1"}
