# make demo: install and see it work. make test: every claim of behaviour, in four minutes, the same each time.
# make test-all: the long and the slow tests as well, with seeds drawn anew. Nothing but Python >= 3.11 is needed, and Debian for vm-test.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# one thread per process: the matrices are small, and threads that wait for each other only cost time
export OMP_NUM_THREADS := 1
# some container images forbid compiled files: each of a thousand children would then compile canid anew
unexport PYTHONDONTWRITEBYTECODE
# two more than there are processors: some tests wait for a recording that plays in real time
WORKERS ?= $(shell expr $$(getconf _NPROCESSORS_ONLN) + 2)

# every version, of what is required by the way too; users' own `pip install` is free. Twice: pip's isolated builds
# take the one or the other, by pip's version
INSTALL := PIP_CONSTRAINT=constraints.txt PIP_BUILD_CONSTRAINT=constraints.txt $(BIN)/pip install --quiet --disable-pip-version-check --no-compile
# on all processors, and once: workers that start together would each compile the same files
COMPILE := $(BIN)/python -m compileall -qq -j 0 $(VENV)/lib canid canid_study || true

.PHONY: demo test test-all lint types check check-long check-rest newest constraints docs screenshots vm-test vm-test-drives vm-test-devices clean
.DELETE_ON_ERROR:

demo: $(VENV)/.installed
	$(BIN)/canid demo

# types along with the tests: mypy says one line at its end
test: lint
	@$(MAKE) --no-print-directory --jobs 2 types check

# one after the other: some tests measure time
test-all: test
	@$(MAKE) --no-print-directory check-long
	@$(MAKE) --no-print-directory check-rest
	@$(MAKE) --no-print-directory docs
	@$(MAKE) --no-print-directory vm-test
	@$(MAKE) --no-print-directory newest

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/mypy

# in a network namespace of its own, so that no packet leaves the machine
check: $(VENV)/.dev
	tests/bus/alone $(BIN)/pytest -n $(WORKERS) --dist worksteal -m "not slow and not long" $(PYTEST_ARGS)

# with fixed seeds as well; of the files that have such tests, which is half of the collection
check-long: $(VENV)/.dev
	tests/bus/alone $(BIN)/pytest -n $(WORKERS) --dist worksteal -m "long and not slow" $(PYTEST_ARGS) \
	    $$(grep -rl --include='*.py' 'mark\.long' tests canid)

# a drawn sixth of what is slow, and all that draws, with drawn seeds; CANID_ALL_CASES=1: all of what is slow
check-rest: $(VENV)/.dev
	CANID_SEED=$${CANID_SEED:-drawn} tests/bus/alone $(BIN)/pytest -n $(WORKERS) --dist worksteal -m "slow or draws" $(PYTEST_ARGS)

# the same tests with the newest release of everything, in an environment of its own, and which releases those are
newest:
	$(PYTHON) -m venv --clear $(VENV)-newest
	$(VENV)-newest/bin/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	$(VENV)-newest/bin/pip freeze --exclude-editable | diff --ignore-case constraints.txt - || echo "on the right: newer releases than constraints.txt"
	tests/bus/alone $(VENV)-newest/bin/pytest -n $(WORKERS) --dist worksteal -m "not slow" $(PYTEST_ARGS)

# constraints.txt anew: the newest releases that pyproject.toml allows and the oldest Python takes (Debian 12 has 3.11.2)
constraints: $(VENV)/bin/pip
	@mkdir -p build
	$(BIN)/pip install --quiet --disable-pip-version-check --dry-run --ignore-installed --report build/pins.json \
	    --python-version 3.11.0 --only-binary :all: --target build/pins '.[dev]'
	$(BIN)/python tests/packaging/pins.py build/pins.json >constraints.txt

# warnings are errors: a link or an anchor that leads nowhere, a page that is in no table of contents
docs: $(VENV)/.dev
	$(BIN)/sphinx-build -q -W --keep-going -n -E -j 2 -b html docs build/docs
	@echo "build/docs/index.html"

# the pictures in docs/images: of the live page, the terminal view and the pages of reports
screenshots: $(VENV)/.dev
	$(BIN)/python docs/screenshots.py

# the tests on kernel SocketCAN: here where this kernel has it; where not, in two virtual machines of one processor each
VCAN := tests/bus/alone $(BIN)/pytest -m vcan $(PYTEST_ARGS)
WHOLE_DRIVES := $(addprefix tests/bus/test_,burst.py hidden_effects.py same_numbers.py)

vm-test: $(VENV)/.dev
	@if tests/bus/alone ip link show vcan0 >/dev/null 2>&1; \
	then CANID_BUSES=vcan $(VCAN) tests/bus; \
	else $(MAKE) --no-print-directory --keep-going --jobs 2 --output-sync=target vm-test-drives vm-test-devices; \
	fi

vm-test-drives: $(VENV)/.dev
	@CANID_BUSES=vcan tests/bus/vm/boot $(VCAN) -p no:cacheprovider $(WHOLE_DRIVES)

vm-test-devices: $(VENV)/.dev
	@CANID_BUSES=vcan tests/bus/vm/boot $(VCAN) -p no:cacheprovider $(addprefix --ignore=,$(WHOLE_DRIVES)) tests/bus

clean:
	rm -rf $(VENV) $(VENV)-newest .vm .pytest_cache .mypy_cache .ruff_cache .hypothesis build dist

$(VENV)/bin/pip:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "canid needs Python 3.11 or newer: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)

# stamps: a second call installs nothing, unless the dependencies have changed
$(VENV)/.installed: pyproject.toml constraints.txt | $(VENV)/bin/pip
	$(INSTALL) --editable '.[report]'
	@$(COMPILE)
	@touch $@

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/bin/pip
	$(INSTALL) --editable '.[dev]'
	@$(COMPILE)
	@touch $@ $(VENV)/.installed
