# Everything sets itself up: a machine with Python 3.11 to 3.13 and make is enough.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
ARGS ?=
# Matrices are small: threads of the linear algebra would only wait for each other.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
# A fleet is many processes: without stored bytecode each would compile the sources of all that it imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo kernels compile test campaign fuzz measure mutation lint docs wheel clean

help:
	@echo "make demo      three simulated helicopters fly in formation; ARGS=\"--seconds 40\" ends by itself"
	@echo "make test      unit tests, and fleets of real processes (about thirteen minutes on two cores)"
	@echo "make campaign  long flights that vary what make test flies once, and new examples for the property tests"
	@echo "make fuzz      coverage-guided fuzzing of what reads bytes from outside, 5 minutes each; ARGS=\"codec 60\""
	@echo "make mutation  how many changes of the safety functions the unit tests notice (two hours)"
	@echo "make measure   size, cost and latency of this commit, added to those of earlier ones (2 minutes, idle computer)"
	@echo "make lint      formatting, types, allowed imports"
	@echo "make docs      the documentation site, in build/site"
	@echo "make wheel     source archives and wheels in dist, checked, and flown from empty environments"
	@echo "make clean     remove the virtual environment and caches"

# uv installs in seconds what takes pip a minute; pip does it where uv, or a package for uv, cannot be had.
UV = $(if $(shell uv --version 2> /dev/null),uv,$(BIN)/python -m uv)
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
define install
	@echo "installing rcopterx$(1) into $(VENV) with uv"
	@$(UV) pip install --quiet --python $(BIN)/python $(2) 2> /dev/null \
	|| { echo "uv failed: pip installs the same, which takes a minute"; \
	     $(BIN)/python -m ensurepip > /dev/null && $(PIP) -e '.$(1)' -e studies; }
endef

# What compiling needs; the other packages are installed meanwhile.
$(VENV)/.compiler:
	@$(PYTHON) -c 'import sys; sys.exit(0 if (3, 11) <= sys.version_info[:2] <= (3, 13) else "Python 3.11 to 3.13 is needed, this is %d.%d; try make PYTHON=python3.11" % sys.version_info[:2])'
	@$(PYTHON) -m venv --without-pip $(VENV)
	@$(UV) --version > /dev/null 2>&1 \
	|| $(PYTHON) -m pip --python $(BIN)/python install --quiet --disable-pip-version-check uv 2> /dev/null \
	|| { $(BIN)/python -m ensurepip > /dev/null && $(PIP) uv; } || true
	$(call install,,numba scipy msgspec)
	@touch $@

$(VENV)/.base: pyproject.toml studies/pyproject.toml | $(VENV)/.compiler
	$(call install,,-e . -e studies pip)
	@touch $@

EXTRAS := test ground browser fuzz mutation docs package
$(EXTRAS:%=$(VENV)/.%): $(VENV)/.%: $(VENV)/.base
	$(call install,[$*],-r pyproject.toml --extra $*)
	@touch $@

$(VENV)/.browser $(VENV)/.fuzz $(VENV)/.mutation $(VENV)/.package: $(VENV)/.test

kernels: $(VENV)/.base compile

compile: $(VENV)/.compiler
	@$(BIN)/python -m rcopterx.compiling

demo: $(VENV)/.compiler
	@$(MAKE) --silent --no-print-directory --jobs=2 compile $(VENV)/.ground
	@exec $(BIN)/rcopterx demo $(ARGS)

test: $(VENV)/.test
ifeq ($(strip $(ARGS)),)
	$(BIN)/python tests/run_all.py
else
	$(BIN)/python -m pytest -m "not campaign" $(ARGS)
endif

campaign: $(VENV)/.browser
	$(BIN)/python -m pytest -m campaign $(ARGS)
	$(BIN)/python -m pytest -m lockstep --real-time $(ARGS)
	$(BIN)/python -m pytest -n 2 -m "hypothesis and not integration" --hypothesis-profile=search

fuzz: $(VENV)/.fuzz
	$(BIN)/python -m tests.fuzz.run_fuzz $(ARGS)

mutation: $(VENV)/.mutation
	$(BIN)/python tests/mutation_score.py

measure: $(VENV)/.test
	$(BIN)/python docs/figures/measure_commit.py $(ARGS)

lint: $(VENV)/.test
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --config-file packaging/mkdocs.yml
	@echo "open build/site/index.html"

wheel: $(VENV)/.package
	rm -rf build/lib studies/build dist
	$(BIN)/python -m build
	$(BIN)/python -m build --outdir dist studies
	$(BIN)/twine check --strict dist/*
	$(BIN)/check-wheel-contents dist/*.whl
	$(BIN)/python -m pytest tests/packaging

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info studies/*.egg-info build studies/build dist
