.DEFAULT_GOAL := help
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
DOCS_READY := $(VENV)/.docs-ready
PYTEST_ARGS ?=
PORT ?= 5000
STUDIO_PORT ?= 8421
SCALE ?= laptop
COUNT ?= 4
DEVICE ?= cpu
# One fit keeps a GPU busy: two beside each other take twice as long each (docs/gpu.md).
WORKERS ?= $(if $(filter cuda%,$(DEVICE)),1,$(shell getconf _NPROCESSORS_ONLN))
# Whole files go to one process, which makes what their tests share once, in the order of tests/conftest.py: the longest,
# with few tests each, are not left for the end. More than eight processes would wait for the longest.
PYTEST := -m pytest -n $(WORKERS) --maxprocesses 8 --dist loadfile --no-loadscope-reorder
SWEEP := scale=$(SCALE) sweep.count=$(COUNT) launch=joblib sweep.workers=$(WORKERS) device=$(DEVICE) \
  evaluation.device=$(DEVICE)
SWEEP_ARGS ?=
SLURM ?= /tmp/fractal-exp-slurm

.PHONY: help setup run ablations comparisons test test-all mutations test-launchers dashboard studio docs bench bench-gpu lint clean

help: ## List the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-15s %s\n", $$1, $$2}'

setup: $(READY) ## Create .venv and install all that commands and tests need (several gigabytes, once)

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "fractal-exp needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; name another with: make PYTHON=python3.12 ...")'
	@echo "Setting up $(VENV): the first time takes a few minutes, most of it for torch"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@touch $@

run: $(READY) ## Fit the retina's blood vessels and the classic fern; scores, pictures, dashboard
	@$(BIN)/fractal-train method=collage target=retina method.maps=128
	@$(BIN)/fractal-train method=collage target=known target.name=fern

ablations: $(READY) ## The paper's ablation table (COUNT=4; DEVICE=cuda SCALE=paper COUNT=50 is the paper's own)
	@$(BIN)/fractal-sweep ablations $(SWEEP) $(SWEEP_ARGS)

comparisons: $(READY) ## The methods that the paper compares with, beside both of ours (SCALE=laptop COUNT=4, or paper 100)
	@$(BIN)/fractal-sweep comparisons $(SWEEP) $(SWEEP_ARGS)

test: $(READY) ## Run the tests, one process a core (WORKERS=2; PYTEST_ARGS='-k fern')
	@$(BIN)/python $(PYTEST) $(PYTEST_ARGS)

test-all: $(READY) ## Run the slow tests too: campaigns, more cases of the same, whole sweeps and rehearsals
	@$(BIN)/python $(PYTEST) -m 'slow or not slow' $(PYTEST_ARGS)

mutations: $(READY) ## Make small mistakes in a copy of the code, one at a time, and see whether the tests notice
	@$(BIN)/python tests/mutations/run.py

test-launchers: $(READY) ## Try Slurm, Ray, submitit and a PostgreSQL server for real (root on Debian: installs packages)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test,launchers,server]'
	@tests/cli/slurm.sh start $(SLURM) && trap 'tests/cli/slurm.sh stop $(SLURM)' EXIT; \
	  SLURM_CONF=$(SLURM)/slurm.conf $(BIN)/python -m pytest -m optional

dashboard: $(READY) ## Serve the runs in the browser, best F1 first (PORT=5000, STUDY=name for another than the newest)
	@$(BIN)/python -m fractal_exp.tracking dashboard outputs --port $(PORT) $(if $(STUDY),--study $(STUDY))

studio: $(READY) ## Offer the studio: drop a picture, see its code found, drag the maps, save (STUDIO_PORT=8421)
	@$(BIN)/fractal-studio --port $(STUDIO_PORT)

$(DOCS_READY): $(READY) pyproject.toml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

docs: $(DOCS_READY) ## Build the documentation in build/site; once installed, this needs no network
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "Open build/site/index.html; for its search too: $(BIN)/python -m http.server -d build/site"

bench: $(READY) ## Time operators, an iteration and the renderer against their twins
	@$(BIN)/python -m benchmarks.ops
	@$(BIN)/python -m benchmarks.iteration
	@$(BIN)/python -m benchmarks.render

bench-gpu: $(READY) ## Check and time everything on an NVIDIA GPU
	@$(BIN)/python -m pip install --quiet --editable '.[cuda]'
	@$(BIN)/python -m benchmarks.gpu

lint: $(READY) ## Check style and types with ruff and basedpyright (the public surface strictly)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[lint]'
	@$(BIN)/ruff check .
	@$(BIN)/basedpyright --pythonpath $(BIN)/python --warnings
	@$(BIN)/basedpyright --pythonpath $(BIN)/python --warnings --project pyright-public.json

clean: ## Remove .venv and outputs/
	rm -rf $(VENV) outputs
