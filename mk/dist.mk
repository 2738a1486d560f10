.PHONY: dist version release

dist: $(WEB_STAMP) ## Builds wheels and sdists of all distributions, and the versions that were tested, into dist/
	@bash mk/dist.sh dist

version: ## Gives every distribution a new version: make version V=0.2.0
	@bash mk/version.sh $(V) $(PACKAGES) $(addprefix integrations/,$(INTEGRATIONS))
	@$(MAKE) --no-print-directory openapi

release: $(STAMP) ## Makes a release of what is committed: make release V=1.2.0
	@MAKE="$(MAKE)" $(BIN)/python mk/release.py $(V)
