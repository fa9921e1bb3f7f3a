# Everything runs in a virtual environment that the first target to need it makes.
# Another Python: make test PYTHON=python3.11 VENV=.venv-3.11

PYTHON ?= $(shell for p in python3.13 python3.11 python3; do \
	$$p -c 'import sys; sys.exit(sys.version_info[:2] not in [(3, 13), (3, 11)])' 2>/dev/null && echo $$p && break; done)
VENV ?= .venv
BIN = $(VENV)/bin
READY = $(VENV)/ready

.PHONY: demo test check docs format bench extension samples clean

demo: $(READY)  ## the main job on the sample: a calibration, a picture, a summary in out/
	$(BIN)/python examples/demo.py

test: $(READY)  ## all tests
	$(BIN)/python -m pytest -q

check: $(READY) docs  ## lint, types, tests, the built extension, the documentation
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python scripts/make_extension.py --platform linux-x64
	$(BIN)/python -m pytest -q

docs: $(VENV)/docs-ready  ## the documentation as a site in out/site; a wrong link, reference or formula fails
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(VENV)/bench-ready  ## the paper's method and the peers beside ours: tables, CSV files, charts
	$(BIN)/python benchmarks/run.py

extension: $(READY)  ## one zip per platform in dist/
	$(BIN)/python scripts/make_extension.py

samples: $(READY)  ## make the sample scenes again
	$(BIN)/python sample_scenes/make_samples.py

$(READY): pyproject.toml
	@test -n "$(PYTHON)" || { echo "No Python 3.13 or 3.11 found: install one, or name it: make PYTHON=/path/to/python3.13"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[picture,blender,test,check]'
	touch $@

$(VENV)/bench-ready: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[bench]'
	touch $@

$(VENV)/docs-ready: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	touch $@

clean:
	rm -rf .venv .venv-* out dist build gui-out wheels
