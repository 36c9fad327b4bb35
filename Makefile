# Every target does its own set-up: a virtual environment in .venv with the exact versions of constraints.txt.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo paper test lint types unit wheel bars lowest versions clean

demo: $(READY)  ## recover a reward on FrozenLake 8x8, retrain PPO on it, print the report
	$(BIN)/irl-gym run --env-id FrozenLake-v1 --env-kwargs map_name=8x8 --out runs/demo

paper: $(READY)  ## reproduce the experiments of Ng & Russell (2000): numbers, verdicts, figures (about 6 minutes)
	$(BIN)/irl-gym reproduce ng-russell-2000

# The types take one core for a minute: what else needs no second one is checked beside them.
test: $(READY)  ## everything CI checks
	$(MAKE) -j2 types lint wheel
	$(MAKE) unit

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports

types: $(READY)
	$(BIN)/pyright

unit: $(READY)
	$(BIN)/python -m pytest -n auto --dist loadfile

wheel: $(READY)
	rm -rf dist
	$(BIN)/python -m build --wheel --outdir dist . > /dev/null
	$(BIN)/check-wheel-contents dist

bars: $(READY)  ## the measured bars: slow tests, speed, memory, retraining on every environment, the paper (about an hour)
	$(BIN)/python -m pytest -m slow --ignore tests/fuzz
	$(BIN)/python -m pytest -m slow tests/fuzz -s
	$(BIN)/python -m pytest -m 'hypothesis and not slow' --hypothesis-profile thorough
	$(BIN)/python scripts/measure_speed.py
	$(BIN)/python scripts/measure_progress.py
	$(BIN)/python scripts/measure_retraining.py
	$(BIN)/python scripts/measure_own_agent.py
	$(BIN)/python scripts/measure_learners.py
	$(BIN)/python scripts/measure_state_only.py
	$(BIN)/python scripts/measure_dagger.py
	$(BIN)/python scripts/measure_cloning.py
	$(BIN)/python scripts/measure_metrics.py
	$(BIN)/python scripts/measure_ambiguity.py
	$(BIN)/python scripts/reward_distances.py
	$(BIN)/python scripts/measure_environments.py
	$(BIN)/python scripts/measure_demonstrations.py
	$(BIN)/irl-gym reproduce ng-russell-2000

# Torch is not among the lowest: each of its versions is gigabytes. Tools that only test are the newest.
LOWEST := .lowest
lowest:  ## the tests with the lowest versions that pyproject.toml allows
	test -x $(LOWEST)/bin/python || $(PYTHON) -m venv $(LOWEST)
	grep '^torch==' constraints.txt > $(LOWEST)/torch.txt
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check uv --requirement $(LOWEST)/torch.txt
	VIRTUAL_ENV=$(LOWEST) $(LOWEST)/bin/uv pip install --quiet --resolution lowest-direct --override $(LOWEST)/torch.txt --editable '.[data,minigrid]'
	VIRTUAL_ENV=$(LOWEST) $(LOWEST)/bin/uv pip install --quiet --override $(LOWEST)/torch.txt $(TESTING)
	$(LOWEST)/bin/python -m pytest -n auto --dist loadfile

TESTING := beartype gym-classics hypothesis playwright pytest pytest-xdist
PYTHONS := 3.11 3.12 3.13 3.14
versions:  ## are there wheels of all dependencies for each Python?
	test -x $(LOWEST)/bin/uv || { $(PYTHON) -m venv $(LOWEST) && $(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check uv; }
	for one in $(PYTHONS); do $(LOWEST)/bin/uv pip compile --quiet --python-version $$one --only-binary :all: --all-extras pyproject.toml \
		> /dev/null || exit 1; echo "Python $$one: wheels of every dependency"; done

# torch first and by its pinned version: any other way of asking for it may fetch gigabytes of CUDA. Not compiled: most of what
# these packages hold is never imported.
$(READY): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt torch
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) $(LOWEST) dist runs .pytest_cache .ruff_cache .hypothesis
