"""The built pages in a browser: no message on its console, and no formula that MathJax could not set.

Needs `make docs` before, and Chromium on the path, which no lock can bring; both are said where they are missing.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

PAGES = Path(__file__).parents[2] / "docs" / "_build" / "html"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def loaded(browser: str, page: Path) -> tuple[str, list[str]]:
    """The document after its scripts have run, and what stood on the console."""
    done = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0",
         "--virtual-time-budget=20000", "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=180, check=True,
    )  # fmt: skip
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


@pytest.fixture(scope="module")
def browser() -> str:
    if not (PAGES / "index.html").exists():
        pytest.skip("the pages are not built: make docs")
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"none of {', '.join(BROWSERS)} is on the path")
    return found


@pytest.mark.validate
def test_the_check_sees_what_it_looks_for(browser: str, tmp_path: Path) -> None:
    (tmp_path / "bad.html").write_text('<html><script>console.error("planted")</script><img src="absent.png"></html>')
    _, told = loaded(browser, tmp_path / "bad.html")
    assert any("planted" in line for line in told)


@pytest.mark.validate
def test_every_page_loads_without_a_message_and_sets_its_formulas(browser: str) -> None:
    pages = sorted(page for page in PAGES.rglob("*.html") if "_static" not in page.parts)
    assert len(pages) > 60
    wrong, formulas = {}, 0
    for page in pages:
        text, told = loaded(browser, page)
        formulas += text.count("<mjx-container")
        unset = set(re.findall(r'data-mjx-error="([^"]*)"', text))
        raw = re.findall(r'class="math[^"]*"[^>]*>\s*\\[\[(]', text)  # what was left as it was written
        if told or unset or raw:
            wrong[str(page.relative_to(PAGES))] = (told, unset, len(raw))
    assert not wrong
    assert formulas > 1000
