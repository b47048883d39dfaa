# make             create the environment in .venv, with everything
# make demo        start the node, play recordings into it, print a table, write pictures; installs only what that needs
# make test        run every test
# make test-oldest run every test with the oldest versions that are supported, those of Ubuntu 24.04 (in .venv-oldest)
# make test-install  run the lines of the slim container and of an installation without internet (minutes)
# make soak        attack the filter, recordings and a node for MINUTES=10; prints what was tried and what held
# make site        build the site of the documents in out/site; a broken page is an error
# make lint        run ruff and mypy
# make clean       remove everything that make and the tests created
#
# If Jazzy or Kilted is sourced (ROS_DISTRO), the environment uses it. Otherwise ROS 2 Jazzy is installed from PyPI; these
# wheels are not official.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 4
MINUTES ?= 10
SEED ?= 1
DATA ?=
OLDEST_EXTRAS ?= $(ROS)test
# Python compiles what is imported and keeps it; compiling all that is installed takes a third of the installation.
unexport PYTHONDONTWRITEBYTECODE
PIP := -m pip install --no-compile --quiet --quiet --disable-pip-version-check

ifeq ($(ROS_DISTRO),)
  VENV_OPTIONS :=
  ROS := ros,
else ifneq ($(filter jazzy kilted,$(ROS_DISTRO)),)
  VENV_OPTIONS := --system-site-packages
  ROS :=
else
  $(error ROS 2 $(ROS_DISTRO) is sourced, but only Jazzy and Kilted are supported. Use a shell where no ROS is sourced: \
    make then installs ROS 2 Jazzy from PyPI)
endif

# What is installed; make test also has all that make demo needs.
DEMO := $(VENV)/.ready-$(ROS)demo
ALL := $(VENV)/.ready-$(ROS)dev
OLDEST := .venv-oldest/.ready-$(OLDEST_EXTRAS)

.PHONY: environment demo test test-oldest test-install soak site lint clean
environment: $(ALL)

$(BIN)/python:
	@$(PYTHON) -m venv $(VENV_OPTIONS) $(VENV)

$(DEMO): setup.py | $(BIN)/python
	@echo "Installing what the demo needs in $(VENV) (once; downloads about 180 MB) ..."
	@$(BIN)/python $(PIP) --editable '.[$(ROS)pictures]'
	@touch $@

$(ALL): setup.py | $(BIN)/python
	@echo "Installing what the tests need in $(VENV) (once; downloads about 400 MB) ..."
	@$(BIN)/python $(PIP) --editable '.[$(ROS)dev]'
	@touch $(DEMO) $@

$(OLDEST): setup.py constraints/noble.txt
	@echo "Installing Ubuntu 24.04's versions in .venv-oldest (once) ..."
	@$(PYTHON) -m venv --clear $(VENV_OPTIONS) .venv-oldest
	@.venv-oldest/bin/python $(PIP) --constraint constraints/noble.txt --editable '.[$(OLDEST_EXTRAS)]'
	@touch $@

demo: $(DEMO)
	$(BIN)/socialcircle demo $(if $(DATA),"$$DATA")

test: $(ALL)
	@$(BIN)/socialcircle warm-up  # once, lest each test process compile the same kernels
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(TESTS)

test-oldest: export NUMBA_CACHE_DIR := $(CURDIR)/.venv-oldest/kernels
test-oldest: $(OLDEST)
	@.venv-oldest/bin/socialcircle warm-up
	.venv-oldest/bin/python -m pytest -n $(WORKERS) --dist worksteal $(TESTS)

test-install: $(ALL)
	SOCIALCIRCLE_INSTALL_TESTS=1 $(BIN)/python -m pytest test/deploy

soak: $(ALL)
	cd test && PYTHONPATH=. ../$(BIN)/python -m attack.soak --minutes $(MINUTES) --seed $(SEED)

site: $(ALL)
	$(BIN)/sphinx-build -q -W --keep-going docs out/site

lint: $(ALL)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf $(VENV) .venv-oldest build install log out *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
