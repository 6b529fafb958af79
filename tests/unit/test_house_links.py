"""The check of links that every build of the documentation ends with finds what is broken, and nothing else."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]


def checker():
    spec = importlib.util.spec_from_file_location("local_links", ROOT / "docs/_generate/local_links.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_links_that_lead_somewhere_and_links_that_do_not(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "picture one.png").write_bytes(b"")
    (tmp_path / "inner/second.html").write_text(
        '<h1 id="über">x</h1><a name="old"></a><a href="../first.html#top">x</a>'
    )
    good = ["", "#top", "inner/second.html", "inner/second.html#%C3%BCber", "inner/second.html#old", "mailto:a@b.c"]
    good += ["https://example.org/none.html#none", "picture%20one.png"]
    bad = ["none.html", "#none", "inner/second.html#none", "inner/first.html"]
    links = "".join(f'<a href="{link}">x</a>' for link in (*good, *bad))
    (tmp_path / "first.html").write_text(
        f'<body id="top">{links}<img src="picture%20one.png"><img src="lost.png"></body>'
    )
    (tmp_path / "search.html").write_text('<a href="#made-later">x</a>')
    assert checker().broken(tmp_path) == [f"first.html: {link}" for link in (*bad, "lost.png")]

    (tmp_path / "gone.html").write_text('<a href="none.html">x</a>')
    (tmp_path / "first.html").write_text('<a href="gone.html">x</a>')
    assert checker().broken(tmp_path, {"first.html"}) == ["first.html: gone.html"]


def test_the_build_of_the_documentation_uses_it():
    assert '"local_links"' in (ROOT / "docs/conf.py").read_text()
