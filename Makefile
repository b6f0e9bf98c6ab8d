# Everything runs in .venv, made on first use. Another interpreter: make PYTHON=python3.12 run
PYTHON ?= python3
BIN := .venv/bin

.PHONY: run test check platforms robustness stability accuracy surroundings bench slews peers clean

run: .venv/installed
	$(BIN)/python -m fmu_build examples/iss_dg.toml -o build/iss_dg.fmu
	$(BIN)/python examples/iss_dg.py

test: .venv/installed-dev
	$(BIN)/python -m pytest -n auto --dist worksteal

check: .venv/installed-dev
	$(BIN)/ruff format --check model fmu_build tests examples
	$(BIN)/ruff check model fmu_build tests examples
	$(BIN)/mypy

platforms: .venv/installed-dev
	$(BIN)/python -m pytest -m platforms tests/platforms

robustness: .venv/installed-dev
	$(BIN)/python -m pytest -m robustness tests/robustness

stability: .venv/installed-dev
	$(BIN)/python -m pytest -m stability tests/stability
	cd tests && ../$(BIN)/python -m stability.table

accuracy: .venv/installed-dev
	$(BIN)/python -m pytest -m accuracy tests/accuracy

surroundings: .venv/installed-dev
	$(BIN)/python -m pytest -m surroundings tests/surroundings

bench: .venv/installed-dev
	$(BIN)/python tests/bench/run.py
	PYTHONPATH=tests $(BIN)/python tests/bench/costs.py
	PYTHONPATH=tests $(BIN)/python tests/bench/vessels.py
	PYTHONPATH=tests $(BIN)/python tests/bench/precision.py
	$(BIN)/python tests/bench/propagators.py
	$(BIN)/python tests/bench/from_python.py
	PYTHONPATH=tests $(BIN)/python tests/bench/interrupts.py
	mkdir -p build
	$(BIN)/supervessel trade examples/iss_dg.toml --duration 6000 -o build/iss_dg_trade

slews: .venv/installed-dev
	$(BIN)/python examples/nmpc_slew.py
	$(BIN)/python examples/time_optimal.py
	$(BIN)/python tests/bench/nmpc.py

peers: .venv-peers/installed
	PYTHONPATH=tests .venv-peers/bin/python tests/peers/peers.py
	PYTHONPATH=tests:tests/bench .venv-peers/bin/python tests/peers/work.py
	PYTHONPATH=tests:tests/bench .venv-peers/bin/python tests/peers/composites.py

clean:
	rm -rf .venv .venv-peers build .pytest_cache .mypy_cache .ruff_cache .hypothesis

.venv/installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Python >= 3.11 is needed, $(PYTHON) is older: make PYTHON=python3.12 ..." >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --editable '.[examples]'
	mkdir -p build
	touch $@

.venv/installed-dev: .venv/installed
	$(BIN)/python -m pip install --quiet --group dev
	touch $@

.venv-peers/installed: pyproject.toml
	$(PYTHON) -m venv .venv-peers
	.venv-peers/bin/python -m pip install --quiet --upgrade 'pip>=25.1'
	.venv-peers/bin/python -m pip install --quiet --editable . scipy mpmath
	@for p in mujoco drake bsk pin pythonfmu; do .venv-peers/bin/python -m pip install --quiet $$p || \
	  echo "$$p cannot be installed here: skipped"; done
	touch $@
