# Every target works on a fresh clone with python3 (3.11 or newer) and make; repeated runs only do what changed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
INSTALL := $(PIP) install -c constraints.txt
BENCHMARKS := held_out two_arms semi_synthetic few_images real widths sag calibrate mutations wrong_answers false_alarms clean_kinds starts consistency outliers robot_model solve batch study cluster scaling robots ring rolling_shutter bag arm_errors detectors peers published certificate clocks verify capture capture_images images_and_poses blurred_views stated_numbers live plan stopping error_map meeting local_fits arrays target_poses touch trouble scene scene_recordings running_check report
# The matrices are small: more threads only wait for one another.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# Workers and commands of tests share what one of them compiled.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup demo test journeys test-slow safety torment wheels dist lint docs bench mutants clean
.NOTPARALLEL:

help:
	@echo "make setup      .venv with the package (editable) and what the tests need"
	@echo "make demo       run two simulated arms, capture, calibrate, compare with the truth; installs the core alone"
	@echo "make test       the fast tests;   make test-slow   the statistics"
	@echo "make journeys   longer tests: whole calibrations, browsers, several commands"
	@echo "make safety     links, controllers and processes that fail while arms move; deadlines: run nothing else beside it"
	@echo "make torment    damaged input, faults and hostile words, until SECONDS are over (else until Ctrl-C); SEED=0"
	@echo "make wheels     the wheel in empty environments: the lowest versions allowed, and each Python from 3.11"
	@echo "make dist       wheel and source archive in dist/, checked by twine"
	@echo "make lint       ruff and mypy;    make docs        the documents, in site/"
	@echo "make mutants    which small faults in the sources the tests of their room miss"
	@echo "make bench      benchmarks;       make clean       remove what was made"

setup: $(VENV)/.test

demo: $(VENV)/.core
	$(BIN)/basecal demo

test: $(VENV)/.test
	$(BIN)/python -m pytest -n auto --dist loadfile -m "not journey and not slow and not timed"

journeys: $(VENV)/.test
	$(BIN)/python -m pytest -n auto --dist load -m "journey and not slow and not timed"

test-slow: $(VENV)/.test
	$(BIN)/python -m pytest -n auto -m "slow and not timed"

safety: $(VENV)/.test
	$(BIN)/python -m pytest -m "timed and not slow" || $(BIN)/python -m pytest -m "timed and not slow" --last-failed  # a stalled machine misses once

torment: $(VENV)/.test
	PYTHONPATH=.:tests $(BIN)/python -m torment.run --seed $(or $(SEED),0) $(if $(SECONDS),--seconds $(SECONDS)) $(if $(RECORD),--record)

wheels:
	.ci/wheels

dist: $(VENV)/.dist
	rm -rf dist
	$(BIN)/python -m build --quiet --no-isolation  # the wheel then holds the manual page and completions
	$(BIN)/twine check --strict dist/*

lint: $(VENV)/.test $(VENV)/.lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@if grep -rlE '(src=|<link[^>]*href=)"?(https?:)?//' site --include='*.html'; then echo "these pages load from outside"; exit 1; fi

bench: $(VENV)/.bench
	for each in $(BENCHMARKS); do echo "benchmarks.$$each"; $(BIN)/python -m benchmarks.$$each || exit 1; done

mutants: $(VENV)/.test
	$(BIN)/python -m benchmarks.mutants

clean:
	rm -rf $(VENV) site dist demo_cell .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/.core: pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "python3 is missing: install Python 3.11 or newer (Debian: apt install python3 python3-venv)"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "basecal needs Python 3.11 or newer, $$($(PYTHON) --version 2>&1) is too old: make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "python3 cannot make environments here: apt install python3-venv"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(PIP) install --upgrade "pip>=25.1"
	$(INSTALL) --editable .
	@$(BIN)/python -m compileall -q -j 0 src
	@touch $@

$(VENV)/.test $(VENV)/.lint $(VENV)/.docs $(VENV)/.dist $(VENV)/.bench: $(VENV)/.%: $(VENV)/.core
	$(INSTALL) --group $*
	@touch $@
