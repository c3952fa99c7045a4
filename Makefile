# `make demo` and `make test` set up all they need in .venv (Python 3.11 or newer).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PROTO_BIN := .venv-proto/bin
PIP := -m pip --disable-pip-version-check install --quiet
export PIP_CONSTRAINT := $(CURDIR)/constraints.txt
OURS := engine plugins clients/python clients/ros proto tests

# Two at a time, each file by one of them: the servers of a file are started once.
PYTEST := $(BIN)/python -m pytest --numprocesses 2 --dist loadfile
# What compares kernels with their definitions, and how much of the kernels it must go through.
KERNEL_TESTS := engine/sketchmatch/kernels engine/sketchmatch/api/kernels.py \
  $(patsubst %,tests/unit/test_%.py,alignment confidence correspond constant_force force_histogram \
  hybrid_force raster incremental evidence alternatives relations directions smoothing clearing) tests/plugins/test_similarities.py
KERNEL_SHARE := 99
says = @echo "$(1), on $$($(BIN)/python --version): about $(2) on 2 cores"

.PHONY: demo test test-slow test-all test-units test-interpreted mutation lint proto bench \
  bench-grids bench-histograms bench-match bench-requests bench-searchers bench-server \
  bench-sketches bench-startup experiments \
  fuzz look \
  reference api serve clean web pad lint-web bench-web look-web

demo: $(VENV)/runtime
	@$(BIN)/sketchmatch demo

test: $(VENV)/dev
	$(call says,lint and all tests but the slow ones,5 minutes)
	@$(MAKE) --no-print-directory lint
	$(PYTEST) -m "not slow"

test-slow: $(VENV)/dev
	$(call says,the slow tests,25 minutes)
	$(PYTEST) --hypothesis-profile same -m slow

# With examples that no run had before; the others draw the same ones each time.
test-all: $(VENV)/dev
	$(call says,lint and all tests,30 minutes)
	@$(MAKE) --no-print-directory lint
	$(PYTEST) --hypothesis-profile new

test-units: $(VENV)/dev
	$(call says,the quick tests of engine plugins and server,3 minutes)
	$(PYTEST) -m "not slow" tests/unit tests/plugins tests/server

test-interpreted: $(VENV)/dev
	$(call says,tests of the kernels as plain Python,90 seconds)
	NUMBA_DISABLE_JIT=1 $(PYTEST) --cov sketchmatch.kernels \
	  --cov-fail-under $(KERNEL_SHARE) $(KERNEL_TESTS)

mutation: $(VENV)/dev
	@$(BIN)/python -m tests.mutation $(ARGS)

lint: $(VENV)/dev .venv-proto/tools
	$(BIN)/ruff check $(OURS)
	$(BIN)/ruff format --check --quiet $(OURS)
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache > $(VENV)/lint-imports.log || { cat $(VENV)/lint-imports.log; exit 1; }
	@if [ -x $(PROTO_BIN)/buf ]; then $(PROTO_BIN)/buf lint proto; fi
	@if [ "$$CI" = true ] || { command -v npm && node --eval 'process.exit(parseInt(process.versions.node) < 20 ? 1 : 0)'; } >/dev/null 2>&1; \
	  then $(MAKE) --no-print-directory lint-web; fi

proto: .venv-proto/tools
	$(PROTO_BIN)/buf lint proto
	$(PROTO_BIN)/python proto/generate.py

# The sketch pad and the TypeScript client. Nothing else needs Node.js: without it the server has no
# pad to show, and the tests of it are skipped.
WEB := engine/sketchmatch/server/pad/index.html
web: $(WEB)

$(WEB): clients/node_modules/.package-lock.json $(shell find clients/typescript clients/web proto \
  -name node_modules -prune -o -path '*/src/gen' -prune -o -path '*/dist' -prune -o -type f -print)
	@command -v npm >/dev/null || { echo "the sketch pad is built by Node.js 20 or newer, which is missing"; exit 1; }
	npm --prefix clients run build

clients/node_modules/.package-lock.json: clients/package-lock.json
	@command -v npm >/dev/null || { echo "the sketch pad is built by Node.js 20 or newer, which is missing"; exit 1; }
	npm --prefix clients ci
	@touch $@

pad: $(VENV)/web $(WEB)
	@$(BIN)/sketchmatch serve --web $(ARGS)

lint-web: $(WEB)
	npm --prefix clients run lint

bench-web: $(VENV)/dev $(WEB)
	@$(BIN)/python -m tests.benchmarks.web $(ARGS)

# The pictures of the sketch pad in its documentation: look at them.
look-web: $(VENV)/dev $(WEB)
	@$(BIN)/python -m tests.look_web $(ARGS)

# One picture of every map, floor and drawing as it is segmented by default: look at it.
look: $(VENV)/dev
	@$(BIN)/python -m tests.look $(ARGS)

bench: $(VENV)/dev
	@$(BIN)/python -m tests.benchmarks.stages

bench-grids: $(VENV)/dev
	@$(BIN)/python -m tests.benchmarks.grids $(ARGS)

bench-histograms: $(VENV)/dev
	@$(BIN)/python -m tests.benchmarks.histograms

bench-match: $(VENV)/dev
	@$(BIN)/python -m tests.benchmarks.matches $(ARGS)

bench-requests: $(VENV)/dev
	@$(BIN)/python -m tests.benchmarks.requests $(ARGS)

bench-searchers: $(VENV)/bench
	@$(BIN)/python -m tests.benchmarks.searchers $(ARGS)

bench-server: $(VENV)/dev
	@$(BIN)/python -m tests.benchmarks.server $(ARGS)

bench-sketches: $(VENV)/dev
	@$(BIN)/python -m tests.benchmarks.sketches $(ARGS)

bench-startup: $(VENV)/dev
	@$(BIN)/python -m tests.benchmarks.startup

experiments: $(VENV)/dev
	@$(BIN)/python -m tests.experiments $(ARGS)

reference: $(VENV)/runtime
	$(BIN)/sketchmatch plugins reference > plugins/REFERENCE.md.new
	mv plugins/REFERENCE.md.new plugins/REFERENCE.md

api: $(VENV)/dev
	$(BIN)/python plugins/api_page.py > plugins/API.md.new
	mv plugins/API.md.new plugins/API.md

MINUTES ?= 10
fuzz: $(VENV)/dev
	@$(BIN)/python -m tests.fuzz --minutes $(MINUTES) $(ARGS)

serve: $(VENV)/runtime
	@$(BIN)/sketchmatch serve $(ARGS)

clean:
	rm -rf .venv .venv-newest .venv-proto clients/node_modules engine/sketchmatch/server/pad \
	  clients/typescript/dist clients/typescript/src/gen

# Naming another Python than that of the environment makes the environment anew.
version = $(shell $(1) -c 'import sys; print(sys.version)' 2>/dev/null)
ifneq ($(origin PYTHON),file)
  ifneq ($(call version,$(PYTHON)),$(call version,$(BIN)/python))
    .PHONY: $(VENV)/runtime
    OTHER := yes
  endif
endif

$(VENV)/runtime: pyproject.toml clients/python/pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "sketchmatch needs Python 3.11 or newer; say which with make PYTHON=python3.12"; exit 1; }
	@echo "installing into $(VENV) (once, about a minute)"
	@$(if $(OTHER),rm -rf $(VENV))
	@[ -x $(BIN)/python ] || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python $(PIP) --editable clients/python --editable .
	@touch $@

$(VENV)/dev: $(VENV)/runtime
	@$(BIN)/python $(PIP) --editable '.[dev]'
	@touch $@

$(VENV)/web: $(VENV)/runtime
	@$(BIN)/python $(PIP) --editable '.[dxf,rosbag,web]'
	@touch $@

# Without a wheel for this Python the benchmark leaves the peers out and says so.
$(VENV)/bench: $(VENV)/dev
	@$(BIN)/python $(PIP) --editable '.[bench]' || echo "the peers cannot be installed here"
	@touch $@

# The oldest gRPC that we support, apart: its generator cannot live beside a new protobuf.
.venv-proto/tools: proto/requirements.txt
	@$(PYTHON) -m venv .venv-proto
	@env -u PIP_CONSTRAINT $(PROTO_BIN)/python $(PIP) --only-binary :all: --requirement $< || \
	  { [ "$$CI" != true ] && echo "no contract tools for this Python: the tests that need them are skipped"; }
	@touch $@
