.PHONY: web check-web

WEB := clients/web
WEB_PARTS := $(WEB)/node_modules/.installed
WEB_SOURCES := $(shell find $(WEB)/src $(WEB)/public $(WEB)/scripts -type f -not -name contract.ts 2>/dev/null) \
	$(addprefix $(WEB)/,index.html vite.config.ts vite.viewer.config.ts tsconfig.json postcss.config.cjs) \
	$(CONTRACT) libs/geometry/src/buildarena_geometry/modules/modules.yaml \
	libs/geometry/src/buildarena_geometry/modules/extended.yaml

web: $(WEB_STAMP) ## Builds the dashboard's pages, which the API serves at /

$(WEB_PARTS): $(STAMP) $(WEB)/package-lock.json $(WEB)/.npmrc
	@bash mk/node.sh npm --prefix $(WEB) ci --loglevel error
	@touch $@

$(WEB_STAMP): $(WEB_PARTS) $(WEB_SOURCES)
	@bash mk/node.sh npm --prefix $(WEB) run --silent build
	@touch $@

# Types, lint and logic of the dashboard, without a browser.
check-web: $(WEB_STAMP)
	@bash mk/node.sh npm --prefix $(WEB) run --silent check
	@bash mk/node.sh npm --prefix $(WEB) test

# People who look at a service want its pages; without them it runs all the same.
up: | web-if-it-can-be

.PHONY: web-if-it-can-be
# Without the npm registry the rest can be used; in CI, where everything must run, that is a failure.
web-if-it-can-be: $(STAMP)
	@$(MAKE) --no-print-directory web || { echo "Left out: the dashboard could not be built (make web says why)."; test -z "$$CI"; }
