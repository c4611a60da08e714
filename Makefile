# Two commands do everything: `make run` and `make test`; `make check` is the quick half of the second. Each sets itself up in .venv first; no root is needed.
# `make help` lists the rest.

VENV := .venv
BIN := $(VENV)/bin
AUDIT := $(VENV)/audit
PACKAGES := bus_sim dbc hil onboard
# Interpreter for a new environment: the first of these that starts, is 3.11 or newer and can make one. A name on the
# path is not enough: version managers leave names that do not start, Debian's Python comes without ensurepip.
CANDIDATES := python3.13 python3.12 python3.11 python3
USABLE := import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))

ARGS ?=
PYTEST_ARGS ?=
export REQUIRE
# Each program that a test starts, and each start in the guest, would otherwise compile all that it loads.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help run check test test-long coverage lint format models mutants bench docs audit clean

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-9s %s\n", $$1, $$2 }' Makefile
	@echo 'make run ARGS="..." hands options to bus-sim run; make PYTHON=/path/to/python ... chooses the interpreter'

run: $(VENV)/.run ## set up, then show an hour of a real day on the standard site in about a minute
	@$(BIN)/bus-sim run $(ARGS)

check: lint ## set up, lint and types (of the tests too), then the quick tests: under a minute on two quiet processors, no test above a second
	@quick=$$($(BIN)/python -m tests.quick) && \
		$(BIN)/python -m pytest --numprocesses 2 -p tests.quick $(PYTEST_ARGS) $$quick

test: lint ## set up, lint, then all tests on all processors; REQUIRE=all makes a skipped test a failure
	$(BIN)/python -m pytest --numprocesses auto $(PYTEST_ARGS)

test-long: lint ## the same with every case of the long rows (tests/thinned.py): all moments, seeds and sizes
	LONG=yes $(BIN)/python -m pytest --numprocesses auto $(PYTEST_ARGS)

coverage: $(VENV)/.test ## all tests once more, with the lines that they ran; takes twice as long
	$(BIN)/python -m pytest --numprocesses auto --cov --cov-report=term $(PYTEST_ARGS)

lint: $(VENV)/.test ## set up, then ruff (rules and format) and mypy --strict
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict

format: $(VENV)/.test ## put the sources into ruff's format and mend what ruff can mend safely
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

models: $(VENV)/.test ## check the Promela models with SPIN, and runs of the controllers against them
	$(BIN)/python -m pytest tests/models

mutants: $(VENV)/.test ## break the product twice for each row of the papers, and see a test of its name fail; takes an hour
	$(BIN)/python -m tests.mutate

bench: $(VENV)/.test ## all figures of bench/, one table each
	@set -e; for script in bench/[!_]*.py; do \
		[ -e "$$script" ] || { echo "make bench: no script in bench/" >&2; exit 2; }; \
		echo "== $$script"; $(BIN)/python "$$script"; \
	done

docs: $(VENV)/.test ## write onboard/contract and docs/network.md anew from the DBC files, docs/systems.md from docs/systems/, charts and times of docs/protocol.md
	$(BIN)/python -m onboard.contract.generate
	$(BIN)/python -m tests.foreign.table
	$(BIN)/python -m onboard.wire.network_doc
	$(BIN)/python -m tests.systems_page
	$(BIN)/python -m tests.protocol

audit: $(VENV)/.run ## whether any pinned library has a known weakness (pip-audit); fails where that could not be looked at
	@test -x $(AUDIT)/bin/pip-audit || { $(BIN)/python -m venv $(AUDIT) && \
		$(AUDIT)/bin/pip install --quiet --disable-pip-version-check 'pip-audit>=2.9,<3'; } || { \
		rm -rf $(AUDIT); echo "make audit: pip could not install pip-audit; is there a network?" >&2; exit 2; }
	@$(BIN)/python -m deploy audit --tool $(AUDIT)/bin/pip-audit

clean: ## remove the environment and everything generated
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage htmlcov runs
	find $(PACKAGES) tests bench -type d -name __pycache__ -prune -exec rm -rf {} +

comma := ,
# What pip says of a network that is not there is 25 lines; the first mistake and what to do are enough.
define install
$(BIN)/python -m pip install --quiet --disable-pip-version-check --retries 2 --editable '$(1)' 2>$(VENV)/pip.log || { \
	grep 'ERROR: ' $(VENV)/pip.log | head -n 1 >&2; \
	echo "make: pip could not install what it needs (all of what it said: $(VENV)/pip.log). Without a network: on a" \
		"computer with one, with the same Python, pip download --dest wheels hatchling editables '$(1)'; bring the folder" \
		"here, then: PIP_NO_INDEX=1 PIP_FIND_LINKS=wheels make $(MAKECMDGOALS)" >&2; \
	exit 2; }
endef

# A stamp is newer than the pyproject.toml that it was installed from.
$(VENV)/.run: pyproject.toml | $(VENV)/.made
	@echo "installing into $(VENV): the program and what make run needs"
	@$(call install,.[sim$(comma)web])
	@touch $@

$(VENV)/.test: pyproject.toml | $(VENV)/.made
	@echo "installing into $(VENV): the program and what make test needs"
	@$(call install,.[sim$(comma)web$(comma)mqtt$(comma)parquet$(comma)test])
	@touch $@ $(VENV)/.run

$(VENV)/.made:
	@python='$(PYTHON)'; \
	for candidate in $${python:-$(CANDIDATES)}; do \
		if "$$candidate" -c '$(USABLE)' >/dev/null 2>&1; then found="$$candidate"; break; fi; \
	done; \
	if [ -z "$${found:-}" ]; then \
		echo "make: no usable Python among: $${python:-$(CANDIDATES)} (3.11 or newer, with the modules venv and ensurepip);" \
			"on Debian and Ubuntu: apt install python3-venv; elsewhere: make PYTHON=/path/to/python" >&2; \
		exit 2; \
	fi; \
	rm -rf $(VENV) && "$$found" -m venv $(VENV) && touch $@
