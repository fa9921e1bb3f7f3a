# Everything runs in a virtual environment that the first target to need it makes.
# Another Python: make test PYTHON=python3.11 VENV=.venv-3.11

PYTHON ?= $(shell for p in python3.13 python3.11 python3; do \
	$$p -c 'import sys; sys.exit(sys.version_info[:2] not in [(3, 13), (3, 11)])' 2>/dev/null && echo $$p && break; done)
VENV ?= .venv
BIN = $(VENV)/bin
CORE = $(VENV)/core-ready
READY = $(VENV)/ready
# The experiments of "make control", in control/examples/. A first look: make control OPTIONS="--seeds 1"
CONTROL = landing impacts g1_landing balance g1 faults rates rates_others wrenches footholds replanning beam as_written planar_arm arm g1_arm
CPP = $(wildcard cpp/*/*.[ch]pp cpp/*/*/*.[ch]pp)
# One process for each processor, or PYTEST_XDIST_AUTO_NUM_WORKERS of them, each with one thread for linear algebra.
PYTEST = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -n auto --dist worksteal

.PHONY: demo test runtime-test check check-second nightly everything docs format bench control control-test cpp wheel extension samples clean

demo: $(CORE)  ## the main job on the sample: a calibration, a picture, a summary in out/; installs no Blender
	$(BIN)/python examples/demo.py

test: $(READY)  ## the quick tests: they cover every module
	$(PYTEST) -m "not slow and not nightly and not window"

runtime-test:  ## the tests of the runtime, with any Python from 3.10 on
	$(PYTHON) -m venv .venv-runtime
	.venv-runtime/bin/python -m pip install --quiet --disable-pip-version-check -e . scipy trimesh pytest pytest-xdist hypothesis array-api-strict
	.venv-runtime/bin/python -m pytest -q -n auto -m "not slow and not window" tests/unit/runtime

check: docs $(VENV)/view-ready test  ## lint, types, the documentation, the extension, the quick tests, slow ones, the whole job in a Blender window
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python scripts/make_extension.py --platform linux-x64
	$(PYTEST) -m "(slow or window) and not nightly"

check-second: $(READY)  ## for a second Python: the extension, the tests in its Blender
	$(BIN)/python scripts/make_extension.py --platform linux-x64
	$(PYTEST) tests/blender -m "not nightly"

nightly:  ## everything, on both Pythons: more examples of each property, every window, whole robots, control; hours
	.ci/run nightly

everything: docs $(VENV)/view-ready $(VENV)/control-ready $(VENV)/simulators-ready  ## the part of "make nightly" with one Python
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python scripts/make_extension.py --platform linux-x64
	$(PYTEST) --hypothesis-profile=full tests control/tests $(TESTS)

docs: $(VENV)/docs-ready  ## the documentation as a site in out/site; a wrong link, reference or formula fails
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
	if [ -x $(BIN)/clang-format ]; then $(BIN)/clang-format -i $(CPP); fi

bench: $(VENV)/bench-ready  ## compare with the paper's method and with peers: tables, CSV files, figures
	$(BIN)/python benchmarks/run.py

control: $(VENV)/control-ready  ## walk, land and balance with the skin in simulation: numbers, figures, animations
	set -e; for name in $(CONTROL); do $(BIN)/python control/examples/$$name.py $(OPTIONS); done

control-test: $(VENV)/control-ready  ## the quick tests of control/; "make nightly" runs its experiments, too
	$(PYTEST) -m "not slow" control/tests

cpp: $(VENV)/cpp-ready  ## the C++ runtime: gcc and clang, tests with sanitizers, use of the installed package, 10 000 frames next to Python
	$(BIN)/clang-format --dry-run -Werror $(CPP)
	CXX=g++ cmake -S cpp -B build/cpp >/dev/null
	cmake --build build/cpp --parallel 2
	ctest --test-dir build/cpp --output-on-failure
	CXX=clang++ cmake -S cpp -B build/cpp-sanitized -DCMAKE_BUILD_TYPE=Debug -DSKIN_CALIB_SANITIZE=ON >/dev/null
	cmake --build build/cpp-sanitized --parallel 2
	ctest --test-dir build/cpp-sanitized --output-on-failure
	cmake --install build/cpp --prefix build/cpp-installed >/dev/null
	cmake -S cpp/tests/package -B build/cpp-package -DCMAKE_PREFIX_PATH=$(CURDIR)/build/cpp-installed >/dev/null
	cmake --build build/cpp-package
	build/cpp-package/uses_skin_calib tests/vectors/small.calibration.json
	CXX=g++ cmake -S cpp -B build/python -DSKIN_CALIB_TESTS=OFF -DSKIN_CALIB_PYTHON=ON -DPYTHON_EXECUTABLE=$(abspath $(BIN)/python) \
		-Dpybind11_DIR=$$($(BIN)/python -m pybind11 --cmakedir) >/dev/null
	cmake --build build/python
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m cpp.tests.differential --frames 10000
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m cpp.tests.run

wheel: $(READY)  ## the Python package in dist/; without what an earlier build left
	rm -rf build
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .

extension: $(READY)  ## one zip per platform in dist/
	$(BIN)/python scripts/make_extension.py

samples: $(READY)  ## make the sample scenes again
	$(BIN)/python sample_scenes/make_samples.py

$(CORE): pyproject.toml
	@test -n "$(PYTHON)" || { echo "No Python 3.13 or 3.11 found: install one, or name it: make PYTHON=/path/to/python3.13"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e '.[author,picture]'
	touch $@

$(READY): $(CORE)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[picture,blender,test,check]'
	touch $@

$(VENV)/bench-ready: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[bench]'
	touch $@

$(VENV)/docs-ready: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	touch $@

$(VENV)/control-ready: $(READY) control/pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e . -e './control[experiments]'
	touch $@

$(VENV)/view-ready: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[view]'
	touch $@

$(VENV)/simulators-ready: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[simulators]'
	touch $@

$(VENV)/cpp-ready: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[cpp]'
	touch $@

clean:
	rm -rf .venv .venv-* out dist build gui-out wheels
