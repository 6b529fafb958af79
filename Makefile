# Everything starts here: `make demo` and `make test` need Python (3.11 to 3.14) and make, nothing else.
# PYTHON=... chooses the interpreter, OUT=... the folder of the demo, SECONDS=... how long to fuzz and TARGET=... what, JOBS=... how many
# processes share the tests.

PYTHON ?= python3 python3.13 python3.12 python3.11 python3.14
OUT ?= demo
SECONDS := 60
TARGET :=
JOBS := 2
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check --no-input
FETCH := $(PIP) install --require-hashes --only-binary :all:
ROOMS := src/fenchel potentials integrators dem

# The editable install links file by file, so a file that is new or gone asks for another install: the stamp carries their names.
FILES := $(shell find $(ROOMS) -type f ! -name '*.pyc' ! -name '.*' | LC_ALL=C sort | cksum | cut -d ' ' -f 1)
PROJECT := $(VENV)/.project-$(FILES)

export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1

.PHONY: demo setup test lint docs bench validate fuzz lock clean
.DELETE_ON_ERROR:

demo: setup
	$(BIN)/fenchel identify --demo -o $(OUT)
	@echo "The report is $(abspath $(OUT))/report.html (the same numbers: report.json; the law: law.py)"

setup: $(PROJECT)

test: $(PROJECT) $(VENV)/.test
	$(BIN)/python -m pytest -q -n $(JOBS) --dist loadfile -m "not validate"

lint: $(PROJECT) $(VENV)/.test $(VENV)/.lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	rm -rf build/types && mkdir -p build/types && cp -RP build/__editable__.*/fenchel build/types/
	$(BIN)/pyright
	PATH="$(BIN):$$PATH" PYTHONPATH=build/types $(BIN)/pyright --verifytypes fenchel --ignoreexternal --outputjson \
	  | $(BIN)/python .ci/public_types.py

docs: $(PROJECT) $(VENV)/.docs
	$(BIN)/python -m sphinx -j auto -W --keep-going -q -b html docs docs/_build/html
	@echo "The pages are $(abspath docs/_build/html)/index.html"

bench: $(PROJECT) $(VENV)/.test
	$(BIN)/python -m pytest -q benchmarks/bench_*.py --benchmark-only

validate: $(PROJECT) $(VENV)/.test
	$(BIN)/python -m pytest -q -m validate

# A seeded search over laws, scenes, files and contact problems (TARGET=laws for one of them), then new random examples of the tests of
# random inputs; two thirds of the time go to the search. What fails is printed as the line to add to tests/regression/fuzz_cases.txt.
fuzz: $(PROJECT) $(VENV)/.test
	@end=$$(( $$(date +%s) + $(SECONDS) )); \
	PYTHONPATH=tests $(BIN)/python -m fuzz --seconds $$(( 2 * $(SECONDS) / 3 )) $(TARGET) || exit 1; \
	round=0; \
	while [ "$$(date +%s)" -lt "$$end" ]; do \
	  round=$$((round + 1)); echo "fuzz: random examples, round $$round"; \
	  $(BIN)/python -m pytest -q -x -m "not validate" --hypothesis-profile=fuzz --hypothesis-seed=random \
	    tests/verification tests/extremes; code=$$?; \
	  [ $$code -eq 0 ] || exit $$code; \
	done

# What runs is locked apart from what tests, checks and documents; uv writes the four for every Python and platform.
# `make lock UPGRADE=--upgrade` takes the newest versions.
LOCK = $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
	--no-emit-find-links --no-header --no-annotate $(UPGRADE)

lock: $(BIN)/uv
	$(LOCK) pyproject.toml --group build -o locks/run.txt
	$(LOCK) --group test -c locks/run.txt -o locks/test.txt
	$(LOCK) --group lint -c locks/run.txt -o locks/lint.txt
	$(LOCK) --group docs -c locks/run.txt -o locks/docs.txt

clean:
	rm -rf build $(VENV)/.project-* docs/_build .pytest_cache .hypothesis .ruff_cache .import_linter_cache .benchmarks

$(BIN)/python:
	@for python in $(PYTHON); do \
	  "$$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null && break; python=; \
	done; \
	if [ -z "$$python" ]; then \
	  echo "fenchel needs Python 3.11 to 3.14; none of these is one: $(PYTHON). Say which one is: make PYTHON=/path/to/python" >&2; \
	  exit 1; \
	fi; \
	"$$python" -m venv $(VENV)

$(VENV)/.run: locks/run.txt | $(BIN)/python
	$(FETCH) -r $<
	@touch $@

$(VENV)/.test $(VENV)/.lint $(VENV)/.docs: $(VENV)/.%: locks/%.txt $(VENV)/.run
	$(FETCH) -r $<
	@touch $@

$(PROJECT): pyproject.toml $(VENV)/.run
	@rm -f $(VENV)/.project-*
	$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

$(BIN)/uv: | $(BIN)/python
	$(PIP) install uv
