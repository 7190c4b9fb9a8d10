# make demo | test | fast | slow | bench | release: each sets up .venv and builds the FMUs first.  PYTHON=python3.12 chooses another Python.
PYTHON ?= python3
BIN := .venv/bin
SOURCES := $(shell find src fmus -type f -not -name '*.pyc' -not -name reference.csv) build_fmus.py
# uv installs in 10 s what takes pip 70; where it is not to be had, or cannot read a mirror that pip knows, pip does it.
# --no-compile: of what is installed, a third is ever imported, and Python keeps its code then
PIP = $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt
UV = $(BIN)/uv pip install --quiet --python $(BIN)/python --constraint constraints.txt
INSTALL = sh -c '{ test -x $(BIN)/uv && $(UV) "$$@" 2>/dev/null; } || $(PIP) "$$@"' install
BY_FILE = -n 2 --dist loadfile --no-loadscope-reorder  # what the tests of a file share is computed once; order: tests/conftest.py
PLUGINS = --disable-plugin-autoload -p xdist.plugin -p _hypothesis_pytestplugin -p gapsense.pytest_plugin  # else pytest rewrites 260 files of src
BUILT = GAPSENSE_BUILT=build/fmus GAPSENSE_NATIVES=build/native  # need not be built again by the tests
unexport PYTHONDONTWRITEBYTECODE  # hundreds of processes would each compile what they import

.PHONY: demo test fast lint types unit scenarios slow bench release fmus natives ziglang clean

demo: fmus
	$(BIN)/gapsense run scenarios/semera_valve
	$(BIN)/gapsense sweep scenarios/semera_valve --seeds 200
	$(BIN)/gapsense figure scenarios/semera_valve

test: lint  # both cores are busy all the time: types beside the builds and the two workers of the tests, then scenarios
	$(MAKE) --jobs 2 unit types scenarios

fast: fmus
	$(BIN)/pytest $(PLUGINS) -q -n 2 -m "not slow" -x

lint: .venv/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/installed
	$(BIN)/mypy

unit: fmus natives
	$(BUILT) $(BIN)/pytest $(PLUGINS) -q $(BY_FILE) -m "not slow" --durations=25

scenarios: fmus natives  # native FMUs have the bits of the Python ones (tests/native/test_scenarios.py), in a quarter of the time
	$(BIN)/gapsense test scenarios --junit build/scenarios.xml $$(ls build/native/*.fmu >/dev/null 2>&1 && echo --native)

slow: fmus natives dist/.native
	$(BUILT) GAPSENSE_RELEASED=dist/native $(BIN)/pytest $(PLUGINS) -q $(BY_FILE) -m slow --durations=40

bench: fmus natives
	$(INSTALL) --editable '.[dev,peers]'
	@test -e .venv-cofmupy/done || { $(PYTHON) -m venv .venv-cofmupy && .venv-cofmupy/bin/python -m pip install --quiet cofmupy==1.0.0 && touch .venv-cofmupy/done; } || echo "cofmupy is not available for this Python: its row is empty"
	$(BIN)/python benchmarks/all.py

release: dist/.native
	cd dist && ../$(BIN)/python -m zipfile -c gapsense-native-fmus.zip native/

dist/.native: $(SOURCES) | ziglang
	rm -rf dist/native
	$(BIN)/python build_fmus.py --native --out dist/native
	@touch $@

ziglang: .venv/installed
	@$(INSTALL) --editable '.[dev,native]' || echo "ziglang is not available: no native FMUs of other platforms"

fmus: build/fmus/.built

build/fmus/.built: .venv/installed $(SOURCES)
	$(BIN)/python build_fmus.py
	@touch $@

natives: build/native/.built

build/native/.built: .venv/installed $(SOURCES)
	$(BIN)/python build_fmus.py --native --platforms here || ! command -v cc  # without a C compiler their tests are skipped
	@mkdir -p $(@D) && touch $@

.venv/installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { echo "$(PYTHON) is older than 3.10. Name another one: make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv .venv
	@$(PIP) uv || echo "uv is not available: pip installs, which takes a minute more"
	$(INSTALL) --editable '.[dev]'
	@$(INSTALL) libcosimpy==0.0.6 2>/dev/null || echo "libcosimpy is not available for this Python: its test is skipped"
	@touch $@

clean:
	rm -rf .venv .venv-cofmupy build dist results
