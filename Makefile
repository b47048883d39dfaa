# make        create the environment in .venv
# make demo   start the node, play recordings into it, print a table, write pictures
# make test   run every test
# make soak   attack the filter, recordings and a node for MINUTES=10; prints what was tried and what held
# make lint   run ruff and mypy
# make clean  remove everything that make and the tests created
#
# If Jazzy is sourced (ROS_DISTRO=jazzy), the environment uses it. Otherwise ROS 2 is installed from PyPI.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 4
MINUTES ?= 10
SEED ?= 1
DATA ?=

ifeq ($(ROS_DISTRO),jazzy)
  VENV_OPTIONS := --system-site-packages
  EXTRAS := dev
else
  VENV_OPTIONS :=
  EXTRAS := ros,dev
endif

READY := $(VENV)/.ready-$(EXTRAS)

.PHONY: environment demo test soak lint clean
environment: $(READY)

$(READY): setup.py
	@echo "Creating the environment in $(VENV) (once; downloads about 400 MB) ..."
	@$(PYTHON) -m venv --clear $(VENV_OPTIONS) $(VENV)
	@$(BIN)/python -m pip install --quiet --quiet --disable-pip-version-check --editable '.[$(EXTRAS)]'
	@touch $@

demo: $(READY)
	$(BIN)/socialcircle demo $(DATA)

test: $(READY)
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

soak: $(READY)
	cd test && PYTHONPATH=. ../$(BIN)/python -m attack.soak --minutes $(MINUTES) --seed $(SEED)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf $(VENV) build install log out *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
