# Everything runs in .venv, made on first use. Another interpreter: make PYTHON=python3.12 run
PYTHON ?= python3
BIN := .venv/bin

# What is installed is the same next month: exact versions, for the tested Python; another takes the newest.
CONSTRAINTS := -c tests/constraints.txt --build-constraint tests/constraints.txt
PIP := pip --disable-pip-version-check

# The part of the suite that the lowest versions of pyproject.toml pass: the model, the twin, FMUs built and flown.
LOWEST := tests/model tests/orbiter tests/build/test_build.py tests/build/test_scene.py \
  $(wildcard tests/build/test_scene_*.py) \
  tests/fmu/test_simulation.py tests/fmu/test_model_description.py tests/fmu/test_model_structure.py \
  $(wildcard tests/fmu/test_*exchange*.py) \
  tests/twin/test_twin.py tests/twin/test_twin_reference.py tests/twin/test_error_state.py tests/trade/test_trade.py \
  tests/examples/test_lqr_hold.py tests/examples/test_identify.py

.PHONY: run test check lowest constraints platforms robustness stability accuracy surroundings thorough bench compatibility slews peers importers clean

run: .venv/installed
	$(BIN)/python -m fmu_build examples/iss_dg.toml -o build/iss_dg.fmu
	$(BIN)/python examples/iss_dg.py

test: .venv/installed-dev
	$(BIN)/python -m pytest -n auto --dist worksteal

check: .venv/installed-dev
	$(BIN)/ruff format --check model fmu_build tests examples
	$(BIN)/ruff check model fmu_build tests examples
	$(BIN)/mypy

lowest: .venv-lowest/installed
	.venv-lowest/bin/python -m pytest -n auto --dist worksteal $(LOWEST)

# Renews tests/constraints.txt, the newest of everything, and from it the list of what the package brings along.
constraints:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
	  { echo "tests/constraints.txt is for Python 3.11: make PYTHON=python3.11 constraints" >&2; exit 1; }
	rm -rf .venv-newest .venv-runtime
	$(PYTHON) -m venv .venv-newest
	.venv-newest/bin/python -m pip install --quiet --upgrade 'pip>=25.3'
	.venv-newest/bin/python -m $(PIP) install --quiet --editable '.[examples]' --group dev editables
	{ echo "# Versions that are tested, by make constraints; other versions of Python take the newest."; \
	  .venv-newest/bin/python -m $(PIP) freeze --all --exclude-editable | sed 's/$$/ ; python_version == "3.11"/'; \
	} > tests/constraints.txt
	.venv-newest/bin/python -m $(PIP) install --quiet 'cyclonedx-bom>=7,<8'
	$(PYTHON) -m venv --without-pip .venv-runtime
	.venv-newest/bin/python -m $(PIP) --python .venv-runtime/bin/python install --quiet $(CONSTRAINTS) .
	.venv-newest/bin/cyclonedx-py environment --output-reproducible --pyproject pyproject.toml --mc-type library \
	  .venv-runtime/bin/python > .venv-runtime/sbom.json
	.venv-newest/bin/python tests/supply/sbom.py .venv-runtime/sbom.json > model/supervessel.cdx.json
	rm -rf .venv-newest .venv-runtime

platforms: .venv/installed-dev
	$(BIN)/python -m pytest -m platforms tests/platforms

# Libraries as users get them, where `make test` has those that are compiled without optimisation.
stability accuracy thorough: export SUPERVESSEL_TESTS_THOROUGH = 1

robustness: .venv/installed-dev
	$(BIN)/python -m pytest -m robustness tests/robustness

stability: .venv/installed-dev
	$(BIN)/python -m pytest -m stability tests
	cd tests && ../$(BIN)/python -m stability.table
	cd tests && ../$(BIN)/python -m nasa.table

accuracy: .venv/installed-dev
	$(BIN)/python -m pytest -m accuracy tests/accuracy
	PYTHONPATH=tests $(BIN)/python -m accuracy.tightness
	PYTHONPATH=tests $(BIN)/python -m accuracy.adversary --scenes 0:500

surroundings: .venv/installed-dev
	$(BIN)/python -m pytest -n auto -m surroundings tests

# All that `make test` runs, on libraries as users get them, and more cases of it.
thorough: .venv/installed-dev
	$(BIN)/python -m pytest -n auto --dist worksteal \
	  -m "not (platforms or robustness or stability or accuracy or surroundings or importers)" tests

bench: .venv/installed-dev
	$(BIN)/python tests/bench/run.py
	PYTHONPATH=tests $(BIN)/python tests/bench/costs.py
	PYTHONPATH=tests $(BIN)/python tests/bench/vessels.py
	PYTHONPATH=tests $(BIN)/python tests/bench/precision.py
	$(BIN)/python tests/bench/propagators.py
	$(BIN)/python tests/bench/from_python.py
	PYTHONPATH=tests $(BIN)/python tests/bench/interrupts.py
	PYTHONPATH=tests $(BIN)/python tests/bench/instructions.py
	mkdir -p build
	$(BIN)/supervessel trade examples/iss_dg.toml --duration 6000 -o build/iss_dg_trade

# What the FMI project asks of tools that export FMUs.
compatibility: .venv/installed
	rm -rf build/compatibility
	$(BIN)/python -m fmu_build.compatibility examples/berth.toml examples/tanker.toml examples/launch_stack.toml \
	  --platform all -o build/compatibility

slews: .venv/installed-dev
	$(BIN)/python examples/nmpc_slew.py
	$(BIN)/python examples/time_optimal.py
	$(BIN)/python tests/bench/nmpc.py

peers: .venv-peers/installed
	PYTHONPATH=tests .venv-peers/bin/python tests/peers/peers.py
	PYTHONPATH=tests:tests/bench .venv-peers/bin/python tests/peers/work.py
	PYTHONPATH=tests:tests/bench .venv-peers/bin/python tests/peers/composites.py
	PYTHONPATH=tests:tests/bench .venv-peers/bin/python tests/peers/orbit.py

# Flies all cells whatever the first ones do, writes the table, then fails if one of them did.
importers: .venv-importers/installed
	.venv-importers/bin/python tests/importers/tools.py
	status=0; export SUPERVESSEL_CACHE="$(CURDIR)/build/importers/cache"; \
	  .venv-importers/bin/python -m pytest -m importers tests/importers || status=$$?; \
	  PYTHONPATH=tests .venv-importers/bin/python -m importers.page && exit $$status

clean:
	rm -rf .venv .venv-* build .pytest_cache .mypy_cache .ruff_cache .hypothesis

.venv/installed: pyproject.toml tests/constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Python >= 3.11 is needed, $(PYTHON) is older: make PYTHON=python3.12 ..." >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade -c tests/constraints.txt 'pip>=25.3'
	$(BIN)/python -m $(PIP) install --quiet $(CONSTRAINTS) --editable '.[examples]'
	mkdir -p build
	touch $@

.venv/installed-dev: .venv/installed
	$(BIN)/python -m $(PIP) install --quiet $(CONSTRAINTS) --group dev
	touch $@

.venv-lowest/installed: pyproject.toml tests/lowest.txt
	$(PYTHON) -m venv .venv-lowest
	.venv-lowest/bin/python -m pip install --quiet --upgrade 'pip>=25.3'
	.venv-lowest/bin/python -m $(PIP) install --quiet -c tests/lowest.txt --editable '.[examples]' \
	  pytest pytest-xdist hypothesis mpmath
	touch $@

.venv-peers/installed: pyproject.toml
	$(PYTHON) -m venv .venv-peers
	.venv-peers/bin/python -m pip install --quiet --upgrade 'pip>=25.1'
	.venv-peers/bin/python -m pip install --quiet --editable . scipy mpmath
	@for p in mujoco drake bsk pin pythonfmu heyoka; do .venv-peers/bin/python -m pip install --quiet $$p || \
	  echo "$$p cannot be installed here: skipped"; done
	touch $@

.venv-importers/installed: pyproject.toml tests/constraints.txt
	$(PYTHON) -m venv .venv-importers
	.venv-importers/bin/python -m pip install --quiet --upgrade -c tests/constraints.txt 'pip>=25.3'
	.venv-importers/bin/python -m $(PIP) install --quiet $(CONSTRAINTS) --editable . pytest scipy mpmath
	touch $@
