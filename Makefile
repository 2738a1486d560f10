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
PACKAGES := libs/geometry libs/simulation libs/besiege libs/benchmark libs/environment libs/store libs/pipeline services/api services/worker services/simworker services/simworker-besiege clients/python clients/cli clients/buildarena
CODE := $(addsuffix /src,$(PACKAGES)) clients/python/hatch_build.py conftest.py tests services/simworker-besiege/tests scenarios benchmarks
NOT_OURS := $(foreach p,$(PACKAGES),--no-emit-package $(patsubst buildarena-buildarena,buildarena,$(patsubst buildarena-python,buildarena-client,buildarena-$(notdir $(p)))))
STAMP := $(VENV)/.installed
# The dashboard as it is served; mk/web.mk builds it.
WEB_OUT := services/api/src/buildarena_api/pages
WEB_STAMP := $(WEB_OUT)/.built
WORKERS ?= $(shell getconf _NPROCESSORS_ONLN)

.PHONY: help install demo up test test-slow test-durations test-long check lock clean openapi

help: ## Lists the targets
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 20

install: $(STAMP) ## Makes the environment in .venv

$(STAMP): requirements.lock $(addsuffix /pyproject.toml,$(PACKAGES))
	@bash mk/install.sh $(VENV) $(PACKAGES)
	@touch $@

demo: $(STAMP) ## One small sweep from start to leaderboard; stops everything at the end
	@$(BIN)/buildarena demo

up: $(STAMP) ## The whole service on this machine until Ctrl-C
	@$(BIN)/buildarena up

# Where a package's tests are, if not in the folder of its name.
TESTS_OF_services/simworker := tests/runner
TESTS_OF_clients/python := tests/client
TESTS_OF_clients/buildarena := tests/notebooks
# Threads' arenas keep what a large test took: with two, and trimming, a worker stays below 1 GB.
RUN_TESTS := MALLOC_ARENA_MAX=2 MALLOC_TRIM_THRESHOLD_=131072 $(BIN)/pytest -n $(WORKERS) --dist loadgroup -rs

ifdef PACKAGE
ifeq ($(filter $(PACKAGE),$(PACKAGES)),)
$(error there is no package $(PACKAGE); the packages are: $(PACKAGES))
endif
PACKAGE_CODE := $(PACKAGE)/src $(or $(TESTS_OF_$(PACKAGE)),tests/$(notdir $(PACKAGE)))

test: $(STAMP)
	@$(BIN)/ruff format --check --quiet $(PACKAGE_CODE)
	@$(BIN)/ruff check --quiet $(PACKAGE_CODE)
	@$(BIN)/mypy --no-error-summary $(firstword $(PACKAGE_CODE))
	@set -o pipefail; $(BIN)/lint-imports | tail -n 3
	@$(RUN_TESTS) -m "not slow" $(lastword $(PACKAGE_CODE))
else
# Types of Python and of the dashboard are each the work of one processor, side by side.
test: $(STAMP) ## Lints, types, import rules and tests; PACKAGE=libs/geometry: those of one package
	@$(MAKE) --no-print-directory -j2 --output-sync=target check check-web-if-it-can-be
	@echo "== 6/6 tests, $(WORKERS) at once (left out: make test-slow, test-long, chaos, peer and bench-*)"
	@$(RUN_TESTS) -m "not slow"
endif

test-slow: check-integrations web-if-it-can-be ## Whole services, browsers, attacks and adapters; CI runs it after make test
	@echo "== slow tests, $(WORKERS) at once"
	@$(RUN_TESTS) -m slow
	@echo "== adapters, each in its own environment"
	@$(MAKE) --no-print-directory test-integrations

test-durations: $(STAMP) ## The tests of make test, and which 30 took longest
	@$(RUN_TESTS) -m "not slow" --durations 30 --durations-min 1

test-long: $(WEB_STAMP) ## Further variants and larger sizes of what make test tries
	@BUILDARENA_TEST_LONG=1 $(RUN_TESTS) -m "long or sized"
	@BUILDARENA_TEST_LONG=1 $(MAKE) --no-print-directory test-integrations

check: $(STAMP) ## Lints, types and import rules alone
	@echo "== 1/6 format"
	@$(BIN)/ruff format --check --quiet $(CODE)
	@echo "== 2/6 lint"
	@$(BIN)/ruff check --quiet $(CODE)
	@echo "== 3/6 types"
	@$(BIN)/mypy --no-error-summary $(addsuffix /src,$(PACKAGES))
	@echo "== 4/6 import rules"
	@set -o pipefail; $(BIN)/lint-imports | tail -n 3

clean: ## Removes the environment, caches and local data
	rm -rf $(VENV) $(VENV)-uv .buildarena .mypy_cache .ruff_cache .pytest_cache .hypothesis

openapi: $(STAMP) ## Writes the API's contract again, and the Python client's types, after an intended change
	@$(BIN)/python -m buildarena_api.contract > tests/data/openapi.json
	@$(MAKE) --no-print-directory client-schemas

lock: ## Compiles requirements.lock again, and the locks of the images from it
	bash mk/uv.sh pip compile --quiet --universal --generate-hashes --all-extras --no-annotate \
		$(NOT_OURS) --custom-compile-command "make lock" -o requirements.lock \
		$(addsuffix /pyproject.toml,$(PACKAGES)) requirements-dev.in
	bash mk/uv.sh pip compile --quiet --universal --generate-hashes --no-annotate -c requirements.lock \
		--custom-compile-command "make lock" -o requirements-hunt.lock requirements-hunt.in
	bash mk/uv.sh pip compile --quiet --universal --generate-hashes --no-annotate \
		--custom-compile-command "make lock" -o requirements-docs.lock requirements-docs.in
	$(MAKE) --no-print-directory lock-images lock-integrations

-include mk/*.mk
