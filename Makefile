# A bare machine needs Python 3.11 or later and make; everything else is installed into .venv.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
BIN := $(VENV)/bin
export DENO_DIR := $(VENV)/deno
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

.PHONY: demo test test-tiles test-density test-solids test-studio test-core explore other-processor \
	pytest lint style types lint-scripts bench docs gallery paper wheel clean

demo: $(VENV)/.installed
	$(BIN)/orbiflow escherize examples/silhouettes/turtle.png --out out/demo

# What takes seconds comes first. On two cores, pages and processes wait for each other, so that three
# workers are faster than two, and the types are checked in what they leave. More threads of linear
# algebra would only be in their way.
test: style
	$(MAKE) --no-print-directory --jobs types pytest

pytest: $(VENV)/.installed-dev
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 3 --dist worksteal -q

# What a change in one part needs: its tests and examples, with the lint of its part. The core is all
# that is of no other part, so that no test is forgotten.
TILES := src/orbiflow/tiles tests/tiles tests/test_awkward_calls.py tests/test_gallery.py \
	$(patsubst %,tests/cli/test_%.py,batch escherize export mistakes)
DENSITY := src/orbiflow/density tests/density tests/cli/test_orientations.py \
	$(wildcard tests/cli/test_density*.py)
SOLIDS := src/orbiflow/solids tests/solids
STUDIO := src/orbiflow/studio tests/studio
CORE := $(filter-out $(TILES) $(DENSITY) $(SOLIDS) $(STUDIO) tests/cli %/__pycache__, \
	$(wildcard src/orbiflow/*.py tests/*.py tests/cli/*.py) reproduction \
	$(patsubst %/,%,$(wildcard src/orbiflow/*/ tests/*/)))

test-tiles: PART := $(TILES)
test-density: PART := $(DENSITY)
test-solids: PART := $(SOLIDS)
test-studio: PART := $(STUDIO)
test-studio: lint-scripts
test-core: PART := $(CORE)
test-tiles test-density test-solids test-studio test-core: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python --threads 2 $(filter-out tests%,$(PART))
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 3 --dist worksteal -q $(PART)

# Random inputs that no run has had before: `make test` takes the same ones for everyone.
explore: $(VENV)/.installed-dev
	ORBIFLOW_EXPLORE=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 3 --dist worksteal -q

# OpenBLAS and torch take other kernels on other processors, which round otherwise: what is decided
# by rounding passes here and fails for somebody else. Prescott and "default" run on every x86-64 and
# are nobody's own, so that they differ from whatever kernels `make test` has taken.
other-processor: $(VENV)/.installed-dev
	OPENBLAS_CORETYPE=Prescott ATEN_CPU_CAPABILITY=default OMP_NUM_THREADS=1 \
		$(BIN)/python -m pytest -n 3 --dist worksteal -q --ignore tests/flows/test_storage.py \
		tests/symmetry tests/fields tests/flows tests/tiles/tilings tests/tiles/geometry \
		tests/studio/test_shapes.py

lint: style types

style: $(VENV)/.installed-dev lint-scripts
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# One thread: two take more processor time together, which the tests beside them need.
types: $(VENV)/.installed-dev
	$(BIN)/pyright --pythonpath $(BIN)/python

lint-scripts: $(VENV)/.installed-dev
	$(BIN)/deno fmt --check --quiet
	$(BIN)/deno lint --quiet
	$(BIN)/deno check --quiet src/orbiflow/studio/static/js src/orbiflow/tiles/write \
		src/orbiflow/drawing/js

bench: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/field.py --quick
	$(BIN)/python benchmarks/escherization.py --quick
	$(BIN)/python benchmarks/likeness_order.py
	$(BIN)/python benchmarks/density_kl.py --quick
	$(BIN)/python benchmarks/density_nll.py --quick
	$(BIN)/python benchmarks/density_truths.py --quick
	$(BIN)/python benchmarks/density_default.py --many --quick
	$(BIN)/python benchmarks/density_record.py --quick || test $$? -eq 2 # its data are not here

docs: $(VENV)/.installed-docs
	$(BIN)/python -m sphinx -b html -W --keep-going -q docs out/site
	@echo "open out/site/index.html"

paper: $(VENV)/.installed-all
	$(BIN)/python -m reproduction --out out/paper

gallery: $(VENV)/.installed-all
	$(BIN)/python docs/gallery/make.py

wheel:
	PYTHON=$(PYTHON) .ci/wheel

clean:
	rm -rf $(VENV) out

$(VENV)/.installed: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) -e '.[studio]'
	touch $@

$(VENV)/.installed-all: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) -e '.[all]'
	touch $@ $(VENV)/.installed

$(VENV)/.installed-dev: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) -e '.[dev]'
	touch $@ $(VENV)/.installed $(VENV)/.installed-all

$(VENV)/.installed-docs: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) -e '.[all,docs]'
	touch $@ $(VENV)/.installed
