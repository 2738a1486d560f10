.PHONY: web test-web check-web bench-web screenshots

WEB := clients/web
WEB_PARTS := $(WEB)/node_modules/.installed
WEB_SOURCES := $(shell find $(WEB)/src $(WEB)/public $(WEB)/scripts -type f -not -name contract.ts 2>/dev/null) \
	$(addprefix $(WEB)/,index.html vite.config.ts vite.viewer.config.ts tsconfig.json postcss.config.cjs) \
	$(CONTRACT) docs/sweep.schema.json libs/geometry/src/buildarena_geometry/modules/modules.yaml \
	libs/geometry/src/buildarena_geometry/modules/extended.yaml

web: $(WEB_STAMP) ## Builds the dashboard's pages, which the API serves at /

$(WEB_PARTS): $(STAMP) $(WEB)/package-lock.json $(WEB)/.npmrc
	@bash mk/node.sh npm --prefix $(WEB) ci --loglevel error
	@touch $@

$(WEB_STAMP): $(WEB_PARTS) $(WEB_SOURCES)
	@bash mk/node.sh npm --prefix $(WEB) run --silent build
	@touch $@

test-web: check-web ## Types, lint, logic and pages of the dashboard, in a real browser
	@$(RUN_TESTS) tests/web

check-web: $(WEB_STAMP) ## Types, lint and logic of the dashboard, without a browser
	@bash mk/node.sh npm --prefix $(WEB) run --silent check
	@bash mk/node.sh npm --prefix $(WEB) test

bench-web: $(WEB_STAMP) ## Measures the pages in a browser that draws in software, and a sweep of 10,000 jobs
	@$(TEST_PYTHON) -m benchmarks.web.bench_web
	@$(TEST_PYTHON) -m benchmarks.web.bench_sweep_page --json .buildarena/bench-web.json

# People who look at a service want its pages; without them it runs all the same.
up: | web-if-it-can-be

.PHONY: web-if-it-can-be
# Without the npm registry the rest can be used; in CI, where everything must run, that is a failure.
web-if-it-can-be: $(STAMP)
	@$(MAKE) --no-print-directory web || { echo "Left out: the dashboard could not be built (make web says why)."; test -z "$$CI"; }

# ALL=folder photographs every page there, light and dark, 1280 and 390 wide, in place of docs/images.
screenshots: $(WEB_STAMP) ## Photographs the dashboard on a demo of its own into docs/images; ALL=FOLDER: every page
	@$(TEST_PYTHON) tests/web/screenshots.py $(if $(ALL),--all $(ALL))
