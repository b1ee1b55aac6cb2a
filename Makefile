# `make` or `make help` lists the verbs. All of them work on a fresh checkout: what they need is installed
# into .venv, which needs python3 (3.11 or later); what they run needs a C compiler.

PYTHON  ?= python3
WORKERS ?= 2
EXTRAS  ?= dev,verify
OUT     ?= reproduction

BIN    := .venv/bin
# Byte code is left to the first import, which halves the time of the installation. The warnings silenced
# here are setuptools' about our editable mode.
PIP    := PYTHONWARNINGS=ignore $(BIN)/pip install --quiet --no-compile --no-build-isolation
SHIPPED = $(shell find springline model codegen runner generated benchmarks -type f -not -name '*.pyc' | LC_ALL=C sort)

.DEFAULT_GOAL := help
.PHONY: help install reproduce test test-full test-product lint format docs docs-tables docs-controllers docs-hardware docs-sweeps docs-first docs-pictures math-accuracy prove firmware bench docs-bench dist clean FORCE

help: ## list the verbs
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | awk -F '\t' '{ printf "  make %-13s %s\n", $$1, $$2 }'

install: .venv/installed ## springline and all development tools in .venv, editable

reproduce: .venv/installed ## regenerate the C, then the paper's runs, tables, figures and claims in OUT=reproduction
	$(BIN)/springline generate
	$(BIN)/springline reproduce -o $(OUT)

test: .venv/installed ## the tests, WORKERS=2 at a time; lists what was skipped and why
	$(BIN)/pytest -n $(WORKERS) --dist worksteal -rs

test-full: .venv/installed ## the tests with those that take minutes
	$(BIN)/pytest -n $(WORKERS) --dist worksteal -rs -m 'not product'

test-product: .venv/installed ## the product of all builds of a kernel, which takes hours
	$(BIN)/pytest -n $(WORKERS) --dist worksteal -rs -m product

lint: .venv/installed ## ruff and mypy
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: .venv/installed ## let ruff put the code in order
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

docs: .venv/installed ## docs/ as a site with search and the reference of everything: build/docs/index.html
	$(PIP) --editable '.[docs]'
	$(BIN)/python docs/site/build.py

docs-tables: .venv/installed ## print the tables of columns, metrics and sensors in docs/scenarios.md anew
	$(BIN)/python -m runner.report.docs_tables --write

docs-controllers: .venv/installed ## simulate the table of docs/controllers.md anew; takes minutes
	$(BIN)/python -m benchmarks.controllers_table --write

docs-hardware: .venv/installed ## run the sweeps of docs/hardware.md, tables and pictures anew; takes minutes
	$(BIN)/python -m benchmarks.hardware_tables --write

docs-sweeps: .venv/installed ## run the sweeps of docs/batch.md and draw its pictures anew; takes minutes
	$(BIN)/python -m benchmarks.sweep_pictures --write

docs-first: .venv/installed ## simulate and draw the picture of README.md anew; takes a minute
	$(BIN)/python -m benchmarks.first_picture --write

docs-pictures: .venv/installed ## draw the pictures of docs/architecture.md and docs/conventions.md anew
	$(BIN)/python -m runner.report.architecture
	$(BIN)/python -m runner.report.conventions

math-accuracy: .venv/installed ## measure the elementary functions against mpmath; writes the table in docs/math.md
	$(BIN)/python -m benchmarks.math_accuracy --write

prove: .venv/installed ## have Gappa prove the rounding errors of elementary functions, for what stands in docs/math.md
	$(BIN)/python -m benchmarks.proofs

firmware: .venv/installed ## the controller on two microcontrollers under emulation: bits, instructions, stack, flash
	$(MAKE) -C examples/cortex_m firmware SPRINGLINE=$(abspath $(BIN))/springline

bench: .venv/installed ## side by side with what one would use instead
	$(PIP) --editable '.[bench]'
	$(BIN)/springline bench

docs-bench: bench ## measure, and put the results into docs/performance.md
	$(BIN)/python -m benchmarks.docs_results

# From what is committed, in a folder of its own: nothing that lies about gets in, and the time is the commit's.
dist: .venv/installed ## sdist and wheel of the last commit in dist/, the same bytes each time, checked by twine
	rm -rf build/release dist
	mkdir -p build/release
	git archive HEAD | tar -x -C build/release
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(BIN)/python -m build --no-isolation --outdir dist build/release
	$(BIN)/python -m twine check --strict dist/*

clean: ## remove what the other verbs made; results in OUT stay
	rm -rf .venv build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The dependencies change with pyproject.toml. The package itself is linked file by file, so it is installed
# anew when a file comes or goes, or setup.py changes; no network is needed for that.
.venv/dependencies: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "springline needs Python 3.11 or later: make PYTHON=python3.11")'
	$(PYTHON) -m venv .venv
	$(PIP) --upgrade pip 'setuptools>=77'
	$(PIP) --editable '.[$(EXTRAS)]'
	@touch $@

.venv/files: .venv/dependencies FORCE
	@printf '%s\n' $(SHIPPED) | cmp -s - $@ || printf '%s\n' $(SHIPPED) > $@

.venv/installed: .venv/dependencies .venv/files setup.py
	$(PIP) --no-deps --editable .
	@touch $@
