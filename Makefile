# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

# ROS_DISTRO=jazzy (default) or kilted chooses the ROS 2; one that is sourced already is used instead.

SHELL := /bin/bash
in_env := source scripts/env.bash &&

# Neither the demo nor the tests should meet other people's robots on the network.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

JOBS ?= 2
LINT ?= lint

FULL := -m '' --robots=all --hypothesis-profile=full

.PHONY: help setup setup-tests demo demo-control demo-identify test test-full test-oldest bench docs docs-tables page lint format lock clean

help:  ## this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 14

setup:  ## virtual environment, ROS 2 and the built package, all under build/
	@scripts/setup

setup-tests:  ## likewise, and what tests, lint and benchmarks need
	@scripts/setup --tests

demo:  ## a simulated robot in the terminal and in the browser; ROBOT=<name or URDF path> MASSLESS=lock MIMIC=free ARGS=<options>
	@DIAG_DYNAMICS_COMPILE=OFF scripts/setup
	@$(in_env) scripts/demo --compile-rest $(if $(ROBOT),--robot "$(ROBOT)") $(if $(MASSLESS),--massless $(MASSLESS)) \
	  $(if $(MIMIC),--mimic $(MIMIC)) $(ARGS)

demo-control: setup  ## a push on an arm under control: detected, and its kinetic energy bounded; a picture; ARGS=<its file>
	@$(in_env) python3 examples/demos/demo_control.py $(or $(ARGS),push_panda.png)

demo-identify: setup  ## a wrong model, identified and calibrated until alarms see pushes; a picture; ARGS=<options>
	@$(in_env) python3 examples/demos/demo_identify.py --picture demo_identify.png $(ARGS)

test: $(or $(LINT),setup-tests)  ## the gate: lint, JavaScript, tests; ARGS=<pytest options>, JOBS=<workers, 0: a debugger>, LINT= for none
	@node --test web/test/*.test.js
	@$(in_env) ROS_PYTHON_CHECK_FIELDS=1 python3 -m pytest --numprocesses $(JOBS) --dist loadfile $(ARGS)

test-full: lint docs  ## everything: all robots and examples, processes, browser, both ROS 2; an hour
	@node --test web/test/*.test.js
	@$(in_env) ROS_PYTHON_CHECK_FIELDS=1 python3 -m pytest --numprocesses $(JOBS) --dist loadfile $(FULL) $(ARGS)
	@ROS_DISTRO=kilted $(MAKE) setup-tests
	@export ROS_DISTRO=kilted; $(in_env) ROS_PYTHON_CHECK_FIELDS=1 python3 -m pytest --numprocesses $(JOBS) --dist loadfile $(FULL) $(ARGS) test/nodes test/live

test-oldest:  ## tests of the numbers with the oldest numba that is supported: needs Python 3.11
	@python3.11 -m venv build/oldest
	@build/oldest/bin/pip install --quiet --disable-pip-version-check numba==0.58.1 numpy==1.26.4 lxml yourdfpy \
	  example-robot-data hypothesis mujoco pin pytest pyyaml scipy
	@PYTHONPATH= build/oldest/bin/python -m pytest test/library/test_numerics.py test/library/test_batch.py \
	  --deselect 'test/library/test_batch.py::test_steps_side_by_side_are_vectorized[moment_step]' $(ARGS)  # LLVM 14 cannot

bench: setup-tests  ## speed of library and nodes, worth of the observer, into benchmarks/results/; ARGS=--short: two minutes' worth
	@$(in_env) python3 benchmarks/run.py $(ARGS)

docs: setup-tests  ## the site, in build/docs: open build/docs/index.html; a warning is an error
	@$(in_env) python3 docs/site/build.py build/docs

docs-tables: setup  ## config/*.yaml anew, from the code
	@$(in_env) python3 docs/tables.py

page:  ## the page of view and report anew, from web/ into diag_dynamics/page/static/: needs Node.js
	@cd web && npm ci --no-audit --no-fund --ignore-scripts && node build.js

lint: setup-tests  ## style, docstrings, imports, types and licences
	@$(in_env) ruff check && ruff format --check && lint-imports --no-logo && mypy && reuse lint --quiet

format: setup-tests  ## put the code in style
	@$(in_env) ruff check --fix; ruff format

lock:  ## uv.lock from pyproject.toml; ARGS=--upgrade takes newer versions
	@PATH="$$PATH:build/uv/bin" uv lock $(ARGS)

clean:  ## delete all that was built
	rm -rf build "$$(dd_root="$$PWD"; . scripts/choose_ros.bash; echo "$$dd_home")" *.egg-info .import_linter_cache .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
