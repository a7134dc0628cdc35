# Everything a checkout can do. `make` alone lists it; each target sets up by itself what it needs.
.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo bake view test check window-test fuzz hard plant bench study images setup setup-dev clean

SCENE ?= grove
SIZE ?= 960x540
# In the grove a second is an hour: stills at dawn, noon, dusk and night; an animation of the day.
TIMES ?= 6.7 12 18.5 20.75
FRAMES ?= 120:552:6
FILE = assets/scenes/$(SCENE).toml
OUT = build/renders/$(SCENE)
ARGS ?=
export PYTHON

PY = .venv/bin/python
BAKELIGHT = .venv/bin/bakelight
SCENES = $(wildcard assets/scenes/*.toml)

help: ## print this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

demo: setup ## bake the grove; stills and an animation in build/renders/grove (SCENE, SIZE, TIMES, FRAMES)
	@set -e; started=$$(date +%s); \
	$(BAKELIGHT) bake $(FILE); \
	$(BAKELIGHT) render $(FILE) --size $(SIZE) $(TIMES:%=--time %) -o $(OUT)/; \
	$(BAKELIGHT) render $(FILE) --size 640x360 --frames $(FRAMES) -o $(OUT)/animation.webp; \
	echo "demo: stills and an animation are in $(OUT), after $$(($$(date +%s) - started)) s; 'make view' opens a window"

bake: setup ## bake all scenes of assets/scenes
	@set -e; for scene in $(SCENES); do $(BAKELIGHT) bake "$$scene"; done

view: setup ## open a window on the grove (SCENE=name for another scene)
	@$(BAKELIGHT) view $(FILE) $(ARGS)

test: setup-dev ## run all tests (ARGS="-k words" for some of them)
	@$(PY) -m pytest $(if $(ARGS),$(ARGS),-n auto --dist loadfile)

check: packages-dev ## formatting, lint, types and the direction of imports
	@$(PY) -m ruff format --check --quiet . || { echo "check: 'make format' mends formatting"; exit 1; }
	@$(PY) -m ruff check --quiet .
	@$(PY) -m mypy
	@arrows=$$(.venv/bin/lint-imports 2>&1) || { echo "$$arrows"; exit 1; }
	@echo "check: formatting, lint, types and imports hold"

.PHONY: format packages-view packages-dev
format: packages-dev ## mend formatting, and what lint can mend by itself
	@$(PY) -m ruff format --quiet .
	@$(PY) -m ruff check --quiet --fix .

window-test: setup-dev ## open windows under Xvfb, with real keys and mouse
	@$(PY) -m pytest tests/pipelines/test_window.py $(ARGS)

fuzz: setup-dev ## read 100,000 damaged files of each kind, and find what is not refused in one line
	@BAKELIGHT_FUZZ=$${BAKELIGHT_FUZZ:-100000} $(PY) -m pytest tests/fuzz $(ARGS)

hard: setup-dev ## run every hard case, and write what was measured to build/hard (ARGS=words)
	@$(PY) -m pipelines.hard.run $(ARGS)

plant: setup-dev ## plant known mistakes in a copy, and see that the tests catch each
	@$(PY) tools/planted_bugs.py $(ARGS)

.PHONY: crash
crash: setup-dev ## kill bakes, fill the disk, flip bits, bake at once, hundreds of times; build/hard/crash.json
	@$(PY) -m tests.hard_crash $(ARGS)

bench: setup-dev ## measure speed and memory against the aims, in one run
	@$(PY) -m pipelines.studies.bench $(ARGS)

study: setup-dev ## run all studies, or one: make study NAME=question
	@$(BAKELIGHT) study $(NAME) $(ARGS)

images: setup-dev ## render the pictures of the README again
	@$(PY) docs/images/make.py
	@$(PY) docs/images/sprites.py

setup: packages-view ## only prepare: .venv, packages, OpenGL
	@tools/setup.sh opengl

setup-dev: packages-dev ## the same, with what tests and studies need
	@tools/setup.sh opengl
	@tools/setup.sh desk

packages-view:
	@tools/setup.sh packages view

packages-dev:
	@tools/setup.sh packages view,dev

clean: ## remove what was generated, but for .venv and the store of baked assets
	@rm -rf build/scenes build/renders build/studies .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	@find maths formats bake runtime pipelines tests docs -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
