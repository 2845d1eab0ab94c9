# Sets up .venv and runs the project in it. Every step leaves a stamp, so that a second call has nothing to do.

PYTHON ?=
WORKERS ?= 2
VENV := .venv
BIN := $(VENV)/bin
COLCON := .colcon

INTERFACES := $(shell find interfaces bt_actions/packages -type f -not -name '*.pyc')
JAVASCRIPT := $(wildcard bt_actions/*/*.js bt_actions/*/static/*.js)
PROJECT := setup.py setup.cfg pyproject.toml package.xml $(shell find trees launch -name '*.y*ml' -o -name '*.launch.py' 2>/dev/null)

# A ROS installation or another environment in the caller's shell must not leak into these.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONHOME PYTHONPATH
unexport RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE

.PHONY: help setup dev demo quick test oracle docs site chaos soak bench bench-short lint types format colcon clean python colcon-python

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 16

setup: $(VENV)/runtime.stamp ## make .venv with ROS 2, the interfaces and bt_actions

dev: $(VENV)/dev.stamp ## setup, and the tools for tests and checks

demo: setup ## pick and place against simulated servers, ten times as fast as real
	$(BIN)/bt-actions run trees/pick_and_place.yaml --sim --speed 10 --check-part 5.0
	@$(BIN)/bt-actions runs --tree pick_and_place | sed -n '2s|^\(....\).*|look at it: $(BIN)/bt-actions view \1|p'

test: lint types ## check the code and run every test
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

quick: lint types ## check the code, and run the tests that need no ROS; a minute
	CI= $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal --without-ros -m "not chaos and not slow"

oracle: dev ## how often trees do what BehaviorTree.CPP did with them; CASES=FILE takes other cases
	$(BIN)/python -m tests.support.oracle $(CASES)

docs: dev ## remake the pages and pictures that come from the code; `make test` fails when one is stale
	$(BIN)/python scripts/goal_doc.py
	$(BIN)/python scripts/yaml_doc.py
	$(BIN)/python scripts/pictures.py
	$(BIN)/python -m scripts.screenshots

site: $(VENV)/docs.stamp ## the pages with a search, in build/site; a link that leads nowhere is an error
	$(BIN)/python -m sphinx --quiet --fresh-env --write-all --fail-on-warning --keep-going -d build/doctrees docs build/site

lint: dev ## ruff: rules and formatting; bandit: security; oxlint and oxfmt: the JavaScript
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/oxlint --deny-warnings bt_actions
	$(BIN)/oxfmt --check $(JAVASCRIPT)
	$(BIN)/bandit --quiet --recursive --configfile pyproject.toml bt_actions

chaos: dev ## every scenario with killed processes and cut networks, and storms; writes docs/reliability.md
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal tests/scenarios -m "" --reliability docs/reliability.md
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal tests --ignore tests/scenarios -m chaos

soak: dev ## 20,000 goals with every fault; an hour or two
	$(BIN)/python scripts/soak.py

bench: dev ## measure everything beside a yardstick, twenty minutes or so; writes docs/performance.md
	$(BIN)/python -m benchmarks --page docs/performance.md

bench-short: dev ## measure the rows that CI holds us to; fails where one is far beyond its limit
	$(BIN)/python -m benchmarks --short

types: dev ## mypy --strict
	$(BIN)/mypy --strict
	$(BIN)/mypy --strict tests/typing/usage.py

format: dev ## put the code into the format of ruff and oxfmt
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .
	$(BIN)/oxfmt $(JAVASCRIPT)

colcon: $(COLCON)/venv.stamp ## build both packages with colcon and run the demo from what it installed
	scripts/colcon.sh $(COLCON)

clean: ## remove what the other targets made
	rm -rf $(VENV) $(COLCON) *.egg-info build

# .venv

python:
	@scripts/venv.sh $(VENV) $(PYTHON)

$(VENV)/interfaces.stamp: $(INTERFACES) | python
	@scripts/compiler.sh
	@rm -rf $(VENV)/wheels
	@scripts/pip.sh $(VENV) "Building the ROS interfaces" wheel --no-deps --wheel-dir $(VENV)/wheels ./interfaces/*_interfaces/
	@scripts/pip.sh $(VENV) "Installing the ROS interfaces" install --no-deps --force-reinstall $(VENV)/wheels/*.whl
	@touch $@

$(VENV)/runtime.stamp: $(VENV)/interfaces.stamp constraints.txt $(PROJECT) | python
	@scripts/pip.sh $(VENV) "Installing ROS 2 Jazzy and bt_actions" install --editable '.[view]'
	@touch $@

$(VENV)/dev.stamp: setup.cfg constraints.txt | $(VENV)/runtime.stamp
	@scripts/pip.sh $(VENV) "Installing the tools for tests and checks" install --editable '.[dev]'
	@touch $@

$(VENV)/docs.stamp: setup.cfg constraints.txt | $(VENV)/runtime.stamp
	@scripts/pip.sh $(VENV) "Installing the tools for the site" install --editable '.[docs]'
	@touch $@

# An environment of its own: colcon builds the interfaces, so their wheels must not be installed.

colcon-python:
	@scripts/venv.sh $(COLCON)/venv $(PYTHON)

$(COLCON)/venv.stamp: setup.cfg bt_actions/packages/build_environment.txt constraints.txt scripts/colcon_requirements.py | colcon-python
	@scripts/compiler.sh
	@$(COLCON)/venv/bin/python scripts/colcon_requirements.py >$(COLCON)/requirements.txt
	@scripts/pip.sh $(COLCON)/venv "Installing ROS 2 Jazzy and colcon" install --requirement $(COLCON)/requirements.txt
	@touch $@
