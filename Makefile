# Two commands matter to a newcomer: `make demo` and `make test`.
SHELL := /bin/bash
# Compiled modules are kept, whatever the machine says: without them every process compiles again all
# that it imports, which is most of what a short one does.
unexport PYTHONDONTWRITEBYTECODE
# The Python to use; without it, set-up looks for one that has wheels for everything.
PYTHON ?=
export PYTHON
VENV := .venv
BIN := $(VENV)/bin
# For programs beside the tests: they use the tests' support package.
TEST_PYTHON := PYTHONPATH=$(CURDIR):$(CURDIR)/tests $(BIN)/python
PACKAGES := libs/geometry libs/simulation libs/besiege libs/benchmark libs/backend services/api services/worker services/simworker clients/python clients/cli
SOURCES := $(addsuffix /src,$(PACKAGES))
CODE := $(SOURCES) clients/python/hatch_build.py conftest.py tests scenarios benchmarks
STAMP := $(VENV)/.installed
# The dashboard as it is served; mk/web.mk builds it.
WEB_OUT := services/api/src/buildarena_api/pages
WEB_STAMP := $(WEB_OUT)/.built
WORKERS ?= $(shell getconf _NPROCESSORS_ONLN)

.PHONY: help install demo up test test-all test-nightly check check-python check-web-if-changed lock clean bench scenario generate

help: ## Lists the targets
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 20

install: $(STAMP) ## Makes the environment in .venv

$(STAMP): requirements.lock requirements-dev.in mk/locked.py $(addsuffix /pyproject.toml,$(PACKAGES))
	@bash mk/install.sh $(VENV) $(PACKAGES)
	@touch $@

demo: $(STAMP) ## One small sweep from start to leaderboard; stops everything at the end
	@$(BIN)/buildarena demo

up: $(STAMP) ## The whole service on this machine until Ctrl-C
	@$(BIN)/buildarena up

# -- What is made of the API's own description: the clients' types -----------------------------
CONTRACT := build/openapi.json
SCHEMAS := clients/python/src/buildarena_client/schemas.py

# Most changes of the code leave the contract as it is, and what is made of it too.
$(CONTRACT): build/.contract ;
build/.contract: $(STAMP) $(shell find $(SOURCES) -name '*.py' -not -path '$(SCHEMAS)')
	@mkdir -p build
	@$(BIN)/python -m buildarena_api.contract >build/openapi.new
	@cmp -s build/openapi.new $(CONTRACT) || mv build/openapi.new $(CONTRACT)
	@rm -f build/openapi.new
	@touch $@

$(SCHEMAS): $(CONTRACT) clients/python/hatch_build.py
	@$(BIN)/python clients/python/hatch_build.py

install: $(SCHEMAS)

# -- Checks and tests ---------------------------------------------------------------------------
# Threads' arenas keep what a large test took: with two, and trimming, a worker stays below 1 GB.
RUN_TESTS := MALLOC_ARENA_MAX=2 MALLOC_TRIM_THRESHOLD_=131072 $(BIN)/pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder -rs
UNMARKED := not ci and not nightly

ifdef PACKAGE
ifeq ($(filter $(PACKAGE),$(PACKAGES)),)
$(error there is no package $(PACKAGE); the packages are: $(PACKAGES))
endif
# Where a package's tests are, if not in the folder of its name.
TESTS_OF_clients/python := tests/client
PACKAGE_TESTS := $(or $(TESTS_OF_$(PACKAGE)),tests/$(notdir $(PACKAGE)))

test: $(STAMP) $(if $(filter clients/%,$(PACKAGE)),$(SCHEMAS))
	@$(BIN)/ruff format --check --quiet $(PACKAGE)/src $(PACKAGE_TESTS)
	@$(BIN)/ruff check --quiet $(PACKAGE)/src $(PACKAGE_TESTS)
	@$(BIN)/mypy --no-error-summary $(PACKAGE)/src
	@$(RUN_TESTS) -m "$(UNMARKED)" $(PACKAGE_TESTS)
else
test: check ## Checks and the tests without a mark; PACKAGE=libs/geometry: those of one package
	@echo "== tests, $(WORKERS) at once"
	@$(RUN_TESTS) -m "$(UNMARKED)"
endif

test-all: test web-if-it-can-be check-integrations ## What CI runs: make test, then browsers, whole services, PyBullet, wheels, adapters
	@echo "== tests of CI, $(WORKERS) at once"
	@$(RUN_TESTS) -m "ci and not nightly"
	@bash mk/integrations.sh test "not nightly" $(INTEGRATIONS)

test-nightly: $(WEB_STAMP) check-integrations ## Both engines and every variant, adapters whole, attack, hunt, soak, containers; 90 min
	@bash mk/nightly.sh $(INTEGRATIONS)

# Types of Python and of the dashboard are each the work of one processor, side by side.
check: $(STAMP) ## Format, lint, types and import rules; the dashboard's where it has changed, and in CI
	@$(MAKE) --no-print-directory -j2 --output-sync=target check-python check-web-if-changed

check-python: $(SCHEMAS)
	@echo "== format"
	@$(BIN)/ruff format --check --quiet $(CODE)
	@echo "== lint"
	@$(BIN)/ruff check --quiet $(CODE)
	@echo "== types"
	@$(BIN)/mypy --no-error-summary $(SOURCES)
	@echo "== import rules"
	@set -o pipefail; $(BIN)/lint-imports | tail -n 3

check-web-if-changed: $(CONTRACT)
	@if [ -n "$$CI" ] || bash mk/web_changed.sh; then $(MAKE) --no-print-directory check-web; fi

# -- What measures, what takes long, what is written again -------------------------------------------
BENCHMARKS := agreement api geometry scale sessions simulation statistics trials

bench: $(STAMP) ## Measures: make bench NAME=geometry; OPTIONS go to the program, JSON to .buildarena/
ifeq ($(filter $(NAME),$(BENCHMARKS)),)
	$(error no benchmark '$(NAME)'; there are: $(BENCHMARKS))
endif
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m benchmarks.$(NAME) --json .buildarena/bench-$(NAME).json $(OPTIONS)

scenario: $(STAMP) ## Plays a long scenario: make scenario NAME=attack; OPTIONS go to the program
	@bash mk/scenario.sh "$(NAME)" $(OPTIONS)

generate: $(STAMP) ## Writes again what a program makes and is committed; NAME=sessions, games, inspect, sweeps, schema, performance, pictures or digests
	@bash mk/generate.sh $(NAME)

clean: ## Removes the environment, caches and local data
	rm -rf $(VENV) $(VENV)-uv build .buildarena .mypy_cache .ruff_cache .pytest_cache .hypothesis

# -- Locks -------------------------------------------------------------------------------------
# Who asks for what stands in the lock: mk/locked.py takes from it what one of them needs.
LOCK := bash mk/uv.sh pip compile --quiet --universal --generate-hashes --annotation-style line \
	--custom-compile-command "make lock"
OURS := $(foreach p,$(PACKAGES),--no-emit-package $(patsubst buildarena-cli,buildarena,$(patsubst buildarena-python,buildarena-client,buildarena-$(notdir $(p)))))

lock: $(STAMP) ## Compiles requirements.lock again, and the locks of the adapters
	$(LOCK) --all-extras $(OURS) -o requirements.lock \
		$(addsuffix /pyproject.toml,$(PACKAGES)) requirements-dev.in requirements-tools.in
	$(MAKE) --no-print-directory lock-integrations

-include mk/*.mk
