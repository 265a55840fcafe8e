# `make demo` and `make test` set everything up by themselves; nothing else is needed on a machine with Python 3.11 or later.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
ONE_THREAD := OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1

.DEFAULT_GOAL := help
.PHONY: address house kernels browser test-gimp-all help demo test test-lowest docs quick release gimp test-gimp gimp-figures bench-gimp translations plugin-zip check check-deep check-trust lint format bench bench-all results guard figures clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 14

INSTALLED := $(VENV)/.installed
PIP := $(BIN)/python -m pip --disable-pip-version-check

$(INSTALLED): pyproject.toml
	"$(PYTHON)" -m venv $(VENV)
	$(PIP) install --quiet --no-compile --editable '.[cli]'
	@touch $@

$(READY): pyproject.toml
	"$(PYTHON)" -m venv $(VENV)
	$(PIP) install --quiet --upgrade pip
	$(PIP) install --quiet --editable '.[test,bench,lint,docs]'
	@touch $(INSTALLED) $@

demo: $(INSTALLED)  ## run the main jobs on the samples, into ./demo, with a page of the pictures
	$(BIN)/python samples/demo.py demo

test: $(READY)  ## every test
	$(ONE_THREAD) $(BIN)/python -m pytest -n auto --dist worksteal

test-lowest:  ## the quick core tests with the lowest version of everything that pyproject.toml allows
	"$(PYTHON)" -m venv $(VENV)-lowest
	$(VENV)-lowest/bin/python -m pip --disable-pip-version-check install --quiet uv
	$(VENV)-lowest/bin/uv pip install --quiet --python $(VENV)-lowest/bin/python --resolution lowest-direct --editable '.[test]'
	$(ONE_THREAD) $(VENV)-lowest/bin/python -m pytest tests/core -n auto --dist worksteal -m 'not slow and not medium' -q

browser:  ## provide Chromium for the tests of pages, where apt-get can; they are skipped without it
	@command -v chromium >/dev/null || { apt-get update -q && apt-get install -q -y --no-install-recommends chromium; } >/dev/null 2>&1 || echo "no Chromium here, so that its tests are skipped"

gimp:  ## provide GIMP 3 for the tests: the system's, or Debian's in a folder of its own
	PYTHON=$(BIN)/python tests/gimp/gimp3.sh provide

test-gimp: $(READY) gimp  ## the plug-in's quick tests in a real GIMP 3 (GIMP_SUITE=sid: in the newest)
	PYTHON=$(BIN)/python TOPOSEAM_GIMP_REQUIRED=1 tests/gimp/gimp3.sh run python -m pytest tests/gimp -q -m 'not slow'

test-gimp-all: $(READY) gimp  ## all of the plug-in's tests there
	PYTHON=$(BIN)/python TOPOSEAM_GIMP_REQUIRED=1 tests/gimp/gimp3.sh run python -m pytest tests/gimp -q

translations:  ## compile the plug-in's translations (needs msgfmt)
	for po in plugin_gimp/toposeam_gimp/locale/*/LC_MESSAGES/*.po; do msgfmt --check-format -o "$${po%.po}.mo" "$$po"; done

bench-gimp: $(READY) gimp  ## Stitch Layers in GIMP against the command line, 12 megapixels
	PYTHON=$(BIN)/python tests/gimp/gimp3.sh run python benchmarks/gimp.py

gimp-figures: $(READY) gimp  ## the pictures of docs/gimp.md, made in a real GIMP
	PYTHON=$(BIN)/python tests/gimp/gimp3.sh run python docs/gimp_figures.py

plugin-zip:  ## the GIMP plug-in as an archive for people without a terminal, into dist/ (needs Python with pip)
	rm -rf build/wheel && TOPOSEAM_KERNELS=0 "$(PYTHON)" -m pip --disable-pip-version-check wheel --quiet --no-deps --wheel-dir build/wheel .
	"$(PYTHON)" plugin_gimp/make_zip.py dist/toposeam-gimp.zip build/wheel/*.whl

kernels: $(READY)  ## compile the kernels of core anew, where there is a C compiler
	$(BIN)/python hatch_build.py

docs: $(READY)  ## the documentation site, into build/site; a dead link or a missing picture is an error
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -c docs . build/site
	@echo "open build/site/index.html"

release: $(READY)  ## build, check with twine and date CHANGELOG.md; nothing is uploaded
	$(PIP) install --quiet --editable '.[release]'
	$(BIN)/python tools/release.py

check: $(READY)  ## the quick loop: lint, types and all tests that take less than about half a second
	$(MAKE) --no-print-directory -j 2 lint quick

quick: $(READY)
	$(ONE_THREAD) $(BIN)/python -m pytest -n auto --dist worksteal -m 'not slow and not medium' -q

check-deep: $(READY)  ## 120 seeded mutations of the code: do the tests notice? (half an hour)
	$(BIN)/python -m pip install --quiet --editable '.[deep]'
	$(ONE_THREAD) $(BIN)/python tests/mutants.py --count 120 -j 2

SEED := $(shell date +%s)
check-trust: $(READY)  ## 18,000 drawn commands and calls, 200 kills, full disks, a second user, with new seeds (an hour)
	TOPOSEAM_FUZZ=32 TOPOSEAM_FUZZ_SEED=$(SEED) TOPOSEAM_KILLS=100 TOPOSEAM_KILLS_SEED=$(SEED) $(ONE_THREAD) $(BIN)/python -m pytest \
		-n auto --dist worksteal tests/fuzz tests/cli/test_any_pictures.py tests/cli/test_any_bytes.py tests/cli/test_ends.py tests/cli/test_machine_fails.py tests/cli/test_rights.py \
		tests/cli/test_second_user.py tests/cli/test_doors.py tests/cli/test_budgets.py tests/cli/commands/test_hostile_stacks.py \
		tests/cli/commands/test_loop_command.py
	$(BIN)/python tests/worst_files.py

ADDRESSED := pyproject.toml CITATION.cff docs/install.md packaging/conda/recipe.yaml
address:  ## fill in where the source lies: make address URL=https://…
	@test -n "$(URL)" || { echo "say where the source lies: make address URL=https://…"; exit 2; }
	sed -i.bak 's|REPOSITORY_URL|$(URL)|g' $(ADDRESSED) && rm -f $(ADDRESSED:=.bak)

lint: $(READY)  ## ruff and mypy
	$(BIN)/python -m ruff check .
	$(BIN)/python -m ruff format --check .
	$(BIN)/python -m mypy

house: $(READY)  ## how easily a stitch is read: files and steps it runs, classes, places of options, JSON, branches
	$(ONE_THREAD) $(BIN)/python tools/house.py

format: $(READY)  ## let ruff rewrite what it can
	$(BIN)/python -m ruff check --fix .
	$(BIN)/python -m ruff format .

bench: $(READY)  ## seams against their peers, in one run (about 5 minutes)
	$(BIN)/python benchmarks/small_seams.py --seams 100
	$(BIN)/python benchmarks/seams.py

results: $(READY)  ## the tables of docs/results.md and docs/heat.md, measured and written there (40 minutes)
	$(BIN)/python benchmarks/results.py -j 2
	$(BIN)/python benchmarks/engines.py --write
	$(BIN)/python docs/results_figures.py
	$(BIN)/python docs/made.py ../benchmarks/seams.py results_figures.py

bench-all: bench results  ## and textures, plates, batches and pattern books against theirs
	$(BIN)/python benchmarks/texture.py
	$(BIN)/python benchmarks/plate.py
	$(BIN)/python benchmarks/batch.py
	$(BIN)/python benchmarks/book.py

guard: $(READY)  ## costs and times of seams, piles, textures, holes, volumes and motifs against the best known
	$(BIN)/python benchmarks/guard.py

figures: $(READY)  ## the documents' pictures, but those of GIMP, into docs/figures
	$(BIN)/python docs/make_figures.py
	$(BIN)/python docs/motif_figures.py
	$(BIN)/python docs/make_pattern_figures.py
	$(BIN)/python docs/texture_figures.py
	$(BIN)/python docs/stitching_figures.py
	$(BIN)/python docs/volume_figures.py
	$(BIN)/python docs/picture_page.py
	$(BIN)/python docs/compared_figures.py
	$(BIN)/python docs/panorama_figures.py
	$(BIN)/python docs/method_figures.py
	$(BIN)/python docs/made.py panorama_figures.py method_figures.py make_figures.py motif_figures.py make_pattern_figures.py texture_figures.py stitching_figures.py volume_figures.py picture_page.py compared_figures.py

clean:  ## remove what the other targets made
	rm -rf $(VENV) $(VENV)-lowest demo build dist .pytest_cache .mypy_cache .ruff_cache
