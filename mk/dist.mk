.PHONY: dist check-dist version release

dist: $(WEB_STAMP) ## Builds wheels and sdists of all distributions, and the versions that were tested, into dist/
	@bash mk/dist.sh dist

# Earlier ones do not know the version of the metadata that hatchling writes.
TWINE := twine==7.0.0

check-dist: dist ## What a package index would say of dist/, without sending it anything
	@bash mk/uv.sh tool run --quiet --from "$(TWINE)" twine check --strict dist/*.whl dist/*.tar.gz

version: ## Gives every distribution a new version: make version V=0.2.0
	@bash mk/version.sh $(V) $(PACKAGES) $(addprefix integrations/,$(INTEGRATIONS))
	@$(MAKE) --no-print-directory openapi

release: $(STAMP) ## Makes a release of what is committed: make release V=1.2.0
	@MAKE="$(MAKE)" $(BIN)/python mk/release.py $(V)
