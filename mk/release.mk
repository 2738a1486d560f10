.PHONY: release docs images

# Earlier ones do not know the version of the metadata that hatchling writes.
TWINE := twine==7.0.0

release: $(WEB_STAMP) ## Builds wheels and sdists into dist/; with V=1.2.0, makes a release of what is committed
# Without the version in its environment, the program itself can ask for the distributions alone.
ifdef V
	@env -u MAKEFLAGS -u V PACKAGES="$(PACKAGES) $(addprefix integrations/,$(INTEGRATIONS))" MAKE="$(MAKE)" $(BIN)/python mk/release.py $(V)
else
	@bash mk/dist.sh dist
	@bash mk/uv.sh tool run --quiet --from "$(TWINE)" twine check --strict dist/*.whl dist/*.tar.gz
endif

docs: $(VENV)/.docs ## The documents as a site in .buildarena/docs, links checked
	@NO_MKDOCS_2_WARNING=1 PYTHONPATH=$(CURDIR):$(CURDIR)/tests $(BIN)/mkdocs build --quiet --clean

$(VENV)/.docs: $(STAMP)
	@bash mk/install_tool.sh $(BIN)/python mkdocs-material
	@touch $@

images: ## Builds the images of the services, with what is in each and how it was made, into dist/images
	@bash mk/images.sh dist/images
