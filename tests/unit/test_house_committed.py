"""Nothing in the repository tells on which machine, or from which address, it was made."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# In pieces, so that this file does not find itself.
FORBIDDEN = re.compile(
    "|".join(
        [
            r"(?<![\w.*)}])/" + f"(?:{'|'.join(('wo' + 'rk', 'ro' + 'ot', 'ho' + 'me', 'Us' + 'ers', 'op' + 't'))})/",
            "py" + r"pi\.org",
            "python" + r"hosted\.org",
            "npm" + r"js\.(?:org|com)",
            "conda" + r"\.anaconda",
            "sha" + "red/(?:design|reference|packings|fclib|hooks)",
            "--(?:extra-)?index" + "-url[ =]",
            "PIP_" + "(?:EXTRA_)?INDEX_URL",
        ]
    )
)


def committed():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True)
    if listed.returncode != 0:
        pytest.skip("not a git checkout")
    files = [ROOT / name for name in listed.stdout.decode().split("\0") if name]
    return [file for file in files if file.is_file()]


def test_no_machine_path_and_no_registry():
    files = committed()
    assert len(files) > 20
    found = []
    for file in files:
        text = file.read_bytes().decode("utf-8", errors="ignore")
        found += [f"{file.relative_to(ROOT)}: {match[0]}" for match in FORBIDDEN.finditer(text)]
    assert found == []


@pytest.mark.parametrize(
    "text",
    ["see /wo" + "rk/x", '"/ro' + 'ot/.cache"', "https://py" + "pi.org/simple", "../sha" + "red/design/style.md"],
)
def test_the_pattern_finds_what_it_should(text):
    assert FORBIDDEN.search(text)


@pytest.mark.parametrize("text", ["a net/ro" + "ot/sum", "the work/home ratio", "optical"])
def test_the_pattern_leaves_the_rest(text):
    assert not FORBIDDEN.search(text)
