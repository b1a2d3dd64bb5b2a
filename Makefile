# make demo   the paper's experiment, from scene to report
# make test   style, types and tests
# make check-docs   what the guides, the notebooks and the examples show, by running them
# make stress  numerical limits: full sizes, and 10 000 random cases of each property; about 20 minutes
# make bench  run time against error, in minutes: tables, figures and a page in out/bench; TABLES="sections skips"
#             for these studies alone
# make bench-full     the same at full size: hours
# make bench-guard    compare the ratios of that run with the committed ones; fails on a loss above 25 %
# make bench-publish  make bench, then docs/benchmarks.md, the committed ratios and the figures that pages quote from
#             it; on an idle machine
# make train  weights of the network of depth: draws scenes, makes examples, trains for TRAIN_MINUTES; hours, on
#             all cores or WORKERS of them, and a GPU where there is one. Goes on from where it was stopped
# make docs   the site of docs/*.md and the API, in out/docs
# make notebooks  the outputs of examples/notebooks anew, by running them
# make gallery  docs/gallery.md and its pictures, of every scene that ships

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out
TRAIN_MINUTES ?= 90

.PHONY: demo test check-docs stress bench bench-full bench-guard bench-publish bench-setup train docs notebooks gallery format clean llvm
.DEFAULT_GOAL := demo

# What the commands need, and beside it what the tests need.
$(VENV)/.ready: pyproject.toml
	@echo "Installing the renderer and the analysis in $(VENV): 1 GB, which takes some minutes ..."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[render]'
	@touch $@

$(VENV)/.ready-dev: $(VENV)/.ready
	@echo "Installing ruff, pyright, pytest and what the tests compare with ..."
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

# Mitsuba's fast mode needs LLVM 17 or newer. Where there is none, root on Debian or Ubuntu gets it;
# anyone else is told what to type, and everything goes on in the slower scalar mode.
llvm: $(VENV)/.ready
	@if $(BIN)/simgen doctor --require-compiled >/dev/null 2>&1; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  echo "installing libllvm19 (for fast rendering) ..."; \
	  export DEBIAN_FRONTEND=noninteractive; \
	  { apt-get install -y -qq libllvm19 || { apt-get update -qq && apt-get install -y -qq libllvm19; }; } \
	    >/dev/null 2>&1 || echo "libllvm19 could not be installed; going on without it"; \
	fi; \
	$(BIN)/simgen doctor

demo: llvm
	$(BIN)/simgen generate paper --out $(OUT)/paper
	$(BIN)/pcii run $(OUT)/paper --out $(OUT)/paper-results
	@echo "Open $(OUT)/paper-results/report.html in a browser."

# Types are checked while loops are compiled, which each worker of the tests would else do, and while tests run.
test: llvm $(VENV)/.ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@folder=$$(mktemp -d); trap 'rm -rf $$folder' EXIT; \
	$(BIN)/pyright >$$folder/types 2>&1 & types=$$!; \
	$(BIN)/pcii sample --out $$folder/data && \
	$(BIN)/pcii run $$folder/data --out $$folder/results --method three-step --method posterior && \
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow and not stress and not guide"; tests=$$?; \
	wait $$types || { cat $$folder/types; exit 1; }; exit $$tests

check-docs: llvm $(VENV)/.ready-dev
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "guide and not slow" tests

stress: llvm $(VENV)/.ready-dev
	$(BIN)/python -m pytest -n 2 -m "stress or hypothesis" --hypothesis-profile=stress

bench-setup: llvm
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'

bench: bench-setup
	$(BIN)/python -m benchmarks $(TABLES) --out $(OUT)/bench

bench-full: bench-setup
	$(BIN)/python -m benchmarks $(TABLES) --full --out $(OUT)/bench-full

bench-guard: $(VENV)/.ready
	$(BIN)/python -m benchmarks guard --out $(OUT)/bench

bench-publish: bench
	$(BIN)/python -m benchmarks publish --out $(OUT)/bench

train: llvm
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[train]'
	$(BIN)/python -m training --out $(OUT) --minutes $(TRAIN_MINUTES) $(addprefix --workers ,$(WORKERS))

docs: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	rm -rf docs/api
	$(BIN)/python -m sphinx -q -E -W --keep-going -b html docs $(OUT)/docs
	@echo "Open $(OUT)/docs/index.html in a browser."

notebooks: llvm $(VENV)/.ready-dev
	$(BIN)/python docs/make_notebooks.py

gallery: llvm
	$(BIN)/python docs/make_gallery.py

format: $(VENV)/.ready-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) $(OUT) build dist docs/api
