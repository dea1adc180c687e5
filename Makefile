# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

# ROS_DISTRO=jazzy (default) or kilted chooses the ROS 2; one that is sourced already is used instead.

SHELL := /bin/bash
in_env := source scripts/env.bash &&

# Demo and tests do not communicate with robots on the network.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

JOBS ?= 2

PYTEST = ROS_PYTHON_CHECK_FIELDS=1 python3 -m pytest --numprocesses $(JOBS) --dist loadfile
FULL := -m '' --robots=all --hypothesis-profile=full

.PHONY: help setup setup-tests demo demo-control demo-identify test test-full test-oldest bench study docs docs-tables page lint format lock clean

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 14

setup:  ## install the virtual environment, ROS 2 and the package under build/
	@scripts/setup

setup-tests:  ## setup plus the packages for tests, lint and benchmarks
	@scripts/setup --tests

demo:  ## show a simulated robot in terminal and browser; ROBOT=<name or URDF path> ARGS=<options>
	@DIAG_DYNAMICS_COMPILE=OFF scripts/setup
	@$(in_env) scripts/demo $(if $(ROBOT),--robot "$(ROBOT)") $(ARGS)

demo-control: setup  ## push a controlled arm: detected, kinetic energy bounded; writes a plot; ARGS=<file>
	@$(in_env) python3 examples/demos/demo_control.py $(or $(ARGS),push_panda.png)

demo-identify: setup  ## identify a wrong model, calibrate thresholds, detect pushes; writes a plot; ARGS=<options>
	@$(in_env) python3 examples/demos/demo_identify.py --picture demo_identify.png $(ARGS)

test: lint  ## lint, JavaScript tests, Python tests; ARGS=<pytest options> JOBS=<workers, 0 for a debugger>
	@node --test web/test/*.test.js
	@$(in_env) $(PYTEST) $(ARGS)

test-full: lint docs  ## all tests: robots, examples, processes, browser, Jazzy and Kilted; one hour
	@node --test web/test/*.test.js
	@trap "exit 130" INT; ($(in_env) $(PYTEST) $(FULL) $(ARGS)) && jazzy=passed || jazzy=failed; \
	export ROS_DISTRO=kilted; \
	$(MAKE) setup-tests && $(in_env) $(PYTEST) $(FULL) $(ARGS) test/nodes test/live && kilted=passed || kilted=failed; \
	echo "Tests on Jazzy $$jazzy, on Kilted $$kilted."; [ $$jazzy$$kilted = passedpassed ]

test-oldest:  ## numerical tests with the oldest supported numba; requires Python 3.11
	@python3.11 -m venv build/oldest
	@build/oldest/bin/pip install --quiet --disable-pip-version-check numba==0.58.1 numpy==1.26.4 lxml yourdfpy \
	  example-robot-data hypothesis pytest pyyaml scipy
	@PYTHONPATH= build/oldest/bin/python -m pytest test/library/test_numerics.py test/library/test_batch.py \
	  -k 'not vectorized and not keep_the_vectors' $(ARGS)  # LLVM 14 vectorizes no loop of batches

bench: setup-tests  ## benchmarks of library, nodes and alarms into benchmarks/results/; ARGS=--short: two minutes
	@$(in_env) python3 benchmarks/run.py $(ARGS)

study: setup-tests  ## compare control laws in simulation, with plots: docs/control-study.md; half an hour
	@$(in_env) python3 benchmarks/study.py $(ARGS)

docs: setup-tests  ## build the site: build/docs/index.html; warnings are errors
	@$(in_env) python3 docs/site/build.py build/docs

docs-tables: setup  ## generate config/*.yaml and the tables of docs from the code
	@$(in_env) python3 docs/tables.py

page:  ## build the page from web/ into diag_dynamics/page/static/; requires Node.js
	@cd web && npm ci --no-audit --no-fund --ignore-scripts && node build.js

lint: setup-tests  ## check style, docstrings, imports, types and licences
	@$(in_env) ruff check && ruff format --check && lint-imports --no-logo && mypy && reuse lint --lines

format: setup-tests  ## format the code
	@$(in_env) ruff check --fix; ruff format

lock:  ## write uv.lock from pyproject.toml; ARGS=--upgrade uses newer versions
	@PATH="$$PATH:build/uv/bin" uv lock $(ARGS)

clean:  ## delete all build results
	rm -rf build "$$(dd_root="$$PWD"; . scripts/choose_ros.bash; echo "$$dd_home")" *.egg-info .import_linter_cache .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
