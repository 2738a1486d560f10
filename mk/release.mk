.PHONY: dist check-dist version release

dist: $(WEB_STAMP) ## Builds wheels and sdists of all distributions, and the versions that were tested, into dist/
	@bash mk/dist.sh dist

# Earlier ones do not know the version of the metadata that hatchling writes.
TWINE := twine==7.0.0

check-dist: dist ## What a package index would say of dist/, without sending it anything
	@bash mk/uv.sh tool run --quiet --from "$(TWINE)" twine check --strict dist/*.whl dist/*.tar.gz

version: ## Gives every distribution a new version: make version V=0.2.0
	@bash mk/version.sh $(V) $(PACKAGES) $(addprefix integrations/,$(INTEGRATIONS))

release: $(STAMP) ## Makes a release of what is committed: make release V=1.2.0
	@MAKE="$(MAKE)" $(BIN)/python mk/release.py $(V)

.PHONY: docs

docs: $(VENV)/.docs ## The documents as a site in .buildarena/docs, links checked
	@NO_MKDOCS_2_WARNING=1 PYTHONPATH=$(CURDIR):$(CURDIR)/tests $(BIN)/mkdocs build --quiet --clean

$(VENV)/.docs: $(STAMP)
	@bash mk/install_tool.sh $(BIN)/python mkdocs-material
	@touch $@

.PHONY: images pin-images

images: $(STAMP) ## Builds the images of the services; dist/images has what is in each and how it was made
	@$(BIN)/python mk/images.py dist/images

NAMING_IMAGES := docker-compose.yml .env.example deploy/docker/Dockerfile $(wildcard deploy/kubernetes/overlays/*/*.yaml)

pin-images: ## Writes the digests of the images that others publish behind their tags; asks their registries
	@bash mk/pin-images.sh $(NAMING_IMAGES)

.PHONY: licences

licences: $(STAMP) ## Licences and pins of everything we depend on, as a table; exit code 1 where one is not known
	@$(BIN)/python mk/licences.py
