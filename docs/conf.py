"""Sphinx configuration. `make docs` builds with every warning an error and runs every example on the pages."""

import sys
from importlib.util import find_spec
from pathlib import Path

import fenchel

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_generate"))

project = "fenchel"
author = "The fenchel developers"
copyright = "The fenchel developers"
version = release = fenchel.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinxcontrib.bibtex",
    "myst_nb",
    "api_pages",
    "command_line",
    "file_keys",
    "law_library",
    "local_links",
    "prose",
]
exclude_patterns = ["_build", "_generate", "**.ipynb_checkpoints"]
suppress_warnings = ["config.cache"]

# the pages show their formulas without a network: MathJax is copied beside them (its package as an extension would forbid parallel builds)
html_static_path = [str(Path(str(find_spec("sphinx-mathjax-offline").origin)).parent / "static")]
mathjax_path = "mathjax/tex-chtml.js"

html_theme = "furo"
html_title = f"fenchel {release}"

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True
nb_render_markdown_format = "myst"  # formulas in what a cell returns

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "unsrt"

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
