# Two commands do everything on a fresh machine with Python (3.11 or newer) and make:
#   make demo   installs, then meshes the shipped South Carolina case
#   make test   installs, then runs the tests
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# The sparse solver works on small dense blocks: more threads only get in its way.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: demo test test-slow check format benchmarks clean

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[test]"
	@touch $@

demo: $(VENV)/installed
	$(BIN)/tidemesh run examples/south_carolina/south_carolina.toml --output out/south_carolina

test: $(VENV)/installed
	$(BIN)/python -m pytest

test-slow: $(VENV)/installed
	$(BIN)/python -m pytest -m "slow or not slow"

check: $(VENV)/installed
	$(BIN)/ruff check src tests benchmarks
	$(BIN)/ruff format --check src tests benchmarks

format: $(VENV)/installed
	$(BIN)/ruff check --fix src tests benchmarks
	$(BIN)/ruff format src tests benchmarks

benchmarks: $(VENV)/installed
	for script in benchmarks/*.py; do $(BIN)/python $$script; done

clean:
	rm -rf $(VENV) out
