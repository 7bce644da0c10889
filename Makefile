# The first of these that is installed; all pinned packages have wheels for each.
PYTHON ?= $(firstword $(foreach v,3.11 3.12 3.13,$(shell command -v python$(v))) python3)
VENV := .venv
BIN := $(VENV)/bin

.DEFAULT_GOAL := help
.PHONY: help run test attack live soak lint format bench peer train results clean

help: ## show these targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

$(VENV)/core: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet -c constraints.txt -e .
	touch $@

$(VENV)/test: $(VENV)/core
	$(BIN)/pip install --quiet -c constraints.txt -e '.[test,train,view,sb3,cluster]'
	touch $@

$(VENV)/dev: $(VENV)/test
	$(BIN)/pip install --quiet -c constraints.txt -e '.[test,train,view,sb3,cluster,dev]'
	touch $@

run: $(VENV)/core ## fly Hard-I, everything simulated behind its real wire
	$(BIN)/perch-hil run hard-i || test $$? -eq 1

test: $(VENV)/test ## run the test suite
	$(BIN)/python -m pytest -n 2 -m "not live"

attack: $(VENV)/test ## fifty times the cases of the attack tests (forged and damaged data, floods)
	PERCH_HIL_ATTACK=50 $(BIN)/python -m pytest -n 2 --timeout 7200 tests/attack

live: $(VENV)/test ## test the live host, in real time: on a machine that does nothing else
	$(BIN)/python -m pytest -m live

MINUTES ?= 10

soak: $(VENV)/core ## one long live run (MINUTES=10): is memory flat, is lateness steady
	$(BIN)/perch-hil soak --minutes $(MINUTES)

lint: $(VENV)/dev ## ruff, format and pyright, as pre-commit runs them
	$(BIN)/pre-commit run --all-files --show-diff-on-failure

format: $(VENV)/dev ## let ruff correct what it can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

$(VENV)/peer: # crazyflow, in an environment of its own
	$(PYTHON) -m venv $@
	$@/bin/pip install --quiet crazyflow==0.4.0

peer: $(VENV)/peer ## install crazyflow beside, so that `make bench` compares with it in the same run (1.2 GB)

bench: $(VENV)/test ## what things cost on this machine, beside their marks (results/bench.json)
	$(BIN)/python -m benchmarks

TRAINED := training_runs
DEVICE ?= cpu
LEARN = train --stage $(1) --device $(DEVICE) --out $(TRAINED)/$(1) $(if $(wildcard $(TRAINED)/$(1)/checkpoint.pt),--resume)

train: $(VENV)/test ## both networks and their tables (DEVICE=cuda: on a GPU); after a stop the same command goes on
	$(BIN)/perch-hil policy $(call LEARN,state)
	$(BIN)/perch-hil policy $(call LEARN,vision)
	$(BIN)/perch-hil policy evaluate $(TRAINED)/state/policy.onnx
	$(BIN)/perch-hil policy evaluate $(TRAINED)/vision/policy.onnx

results: $(VENV)/core ## measure what docs/results.md says (hours); after a stop the same command goes on
	$(BIN)/perch-hil results

clean: ## remove the virtual environment and caches (not the runs)
	rm -rf $(VENV) build *.egg-info .pytest_cache .ruff_cache
