# `make demo` and `make test` set up all they need in .venv (Python 3.11 or newer).
PYTHON ?= python3
BIN := .venv/bin
PROTO_BIN := .venv-proto/bin
PIP := -m pip --disable-pip-version-check install --quiet
export PIP_CONSTRAINT := $(CURDIR)/constraints.txt
OURS := engine plugins clients/python proto tests

.PHONY: demo test lint proto bench bench-histograms bench-searchers bench-startup experiments fuzz reference serve clean

demo: .venv/runtime
	@$(BIN)/sketchmatch demo

# Two at a time, each file by one of them: the servers of a file are started once.
test: lint
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile

lint: .venv/dev .venv-proto/tools
	$(BIN)/ruff check $(OURS)
	$(BIN)/ruff format --check --quiet $(OURS)
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache > .venv/lint-imports.log || { cat .venv/lint-imports.log; exit 1; }
	@if [ -x $(PROTO_BIN)/buf ]; then $(PROTO_BIN)/buf lint proto; fi

proto: .venv-proto/tools
	$(PROTO_BIN)/buf lint proto
	$(PROTO_BIN)/python proto/generate.py

bench: .venv/dev
	@$(BIN)/python -m tests.benchmarks.stages

bench-histograms: .venv/dev
	@$(BIN)/python -m tests.benchmarks.histograms

bench-searchers: .venv/bench
	@$(BIN)/python -m tests.benchmarks.searchers $(ARGS)

bench-startup: .venv/dev
	@$(BIN)/python -m tests.benchmarks.startup

experiments: .venv/dev
	@$(BIN)/python -m tests.experiments $(ARGS)

reference: .venv/runtime
	$(BIN)/sketchmatch plugins reference > plugins/REFERENCE.md.new
	mv plugins/REFERENCE.md.new plugins/REFERENCE.md

MINUTES ?= 10
fuzz: .venv/dev
	@$(BIN)/python -m tests.fuzz --minutes $(MINUTES) $(ARGS)

serve: .venv/runtime
	@$(BIN)/sketchmatch serve $(ARGS)

clean:
	rm -rf .venv .venv-proto

.venv/runtime: pyproject.toml clients/python/pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "sketchmatch needs Python 3.11 or newer; say which with make PYTHON=python3.12"; exit 1; }
	@echo "installing into .venv (once, about a minute)"
	@$(PYTHON) -m venv .venv
	@$(BIN)/python $(PIP) --editable clients/python --editable .
	@touch $@

.venv/dev: .venv/runtime
	@$(BIN)/python $(PIP) --editable '.[dev]'
	@touch $@

# Without a wheel for this Python the benchmark leaves the peers out and says so.
.venv/bench: .venv/dev
	@$(BIN)/python $(PIP) --editable '.[bench]' || echo "the peers cannot be installed here"
	@touch $@

# The oldest gRPC that we support, apart: its generator cannot live beside a new protobuf.
.venv-proto/tools: proto/requirements.txt
	@$(PYTHON) -m venv .venv-proto
	@env -u PIP_CONSTRAINT $(PROTO_BIN)/python $(PIP) --only-binary :all: --requirement $< || \
	  { [ "$$CI" != true ] && echo "no contract tools for this Python: the tests that need them are skipped"; }
	@touch $@
