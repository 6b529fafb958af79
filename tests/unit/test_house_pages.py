"""The first pages keep their word: the law of the README runs, and every target and file that is named exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ["README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "docs/install.md", "docs/howto/fuzz.md"]


def test_the_law_of_the_readme_is_admissible():
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    assert len(blocks) == 1
    found: dict = {}
    exec(blocks[0], found)
    values = dict(E_s=1e7, nu_s=0.2, lambda_w=1e5, mu_w=1e5, H_k=1e6, H_i=5e5, C_0=3e3, theta_f=0.1)
    report = found["soil"].check(**values)
    assert report.admissible is True


@pytest.mark.parametrize("page", PAGES)
def test_every_target_that_a_page_names_is_there(page):
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    named = set(re.findall(r"(?:^ {4}|`|^)make ([a-z]+)", (ROOT / page).read_text(), flags=re.MULTILINE))
    assert named <= targets
    assert {"demo", "setup", "test", "lint", "docs", "bench", "validate", "fuzz", "lock", "clean"} <= targets


@pytest.mark.parametrize("page", PAGES)
def test_every_link_to_a_file_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)#:]+)\)", (ROOT / page).read_text()):
        assert (ROOT / page).parent.joinpath(target).exists(), target
