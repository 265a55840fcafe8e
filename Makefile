# `make demo` and `make test` set everything up by themselves; nothing else is needed on a machine with Python 3.11 or later.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
ONE_THREAD := OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1

.DEFAULT_GOAL := help
.PHONY: help demo test gimp test-gimp gimp-figures bench-gimp translations plugin-zip check lint format bench bench-all figures clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[test,bench,lint]'
	@touch $@

demo: $(READY)  ## join two photographs along a heat seam, into ./demo
	$(BIN)/python samples/demo.py demo

test: $(READY)  ## every test
	$(ONE_THREAD) $(BIN)/python -m pytest -n auto --dist worksteal

gimp:  ## provide GIMP 3 for the tests: the system's, or Debian's in a folder of its own
	PYTHON=$(BIN)/python tests/gimp/gimp3.sh provide

test-gimp: $(READY) gimp  ## the plug-in's tests in a real GIMP 3 (GIMP_SUITE=sid: in the newest)
	PYTHON=$(BIN)/python TOPOSEAM_GIMP_REQUIRED=1 tests/gimp/gimp3.sh run python -m pytest tests/gimp -q

translations:  ## compile the plug-in's translations (needs msgfmt)
	for po in plugin_gimp/toposeam_gimp/locale/*/LC_MESSAGES/*.po; do msgfmt --check-format -o "$${po%.po}.mo" "$$po"; done

bench-gimp: $(READY) gimp  ## Stitch Layers in GIMP against the command line, 12 megapixels
	PYTHON=$(BIN)/python tests/gimp/gimp3.sh run python benchmarks/gimp.py

gimp-figures: $(READY) gimp  ## the pictures of docs/gimp.md, made in a real GIMP
	PYTHON=$(BIN)/python tests/gimp/gimp3.sh run python docs/gimp_figures.py

plugin-zip: $(READY)  ## the GIMP plug-in as an archive for people without a terminal, into dist/
	$(BIN)/python plugin_gimp/make_zip.py dist/toposeam-gimp.zip

check: $(READY)  ## the quick loop: lint, types and all tests that are not slow
	$(MAKE) --no-print-directory lint
	$(ONE_THREAD) $(BIN)/python -m pytest -n auto --dist worksteal -m 'not slow' -q

lint: $(READY)  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(READY)  ## let ruff rewrite what it can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY)  ## seams against their peers, in one run (about 5 minutes)
	$(BIN)/python benchmarks/small_seams.py --seams 100
	$(BIN)/python benchmarks/seams.py

bench-all: bench  ## and textures, plates, stitching, batches and pattern books against theirs
	$(BIN)/python benchmarks/texture.py
	$(BIN)/python benchmarks/plate.py
	$(BIN)/python benchmarks/stitching.py
	$(BIN)/python benchmarks/batch.py
	$(BIN)/python benchmarks/book.py

figures: $(READY)  ## the thesis's figures, into docs/figures
	$(BIN)/python docs/make_figures.py
	$(BIN)/python docs/motif_figures.py
	$(BIN)/python docs/make_pattern_figures.py
	$(BIN)/python docs/texture_figures.py

clean:  ## remove what the other targets made
	rm -rf $(VENV) demo build dist .pytest_cache .mypy_cache .ruff_cache
