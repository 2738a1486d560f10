.PHONY: docs

DOCS_VENV := .venv-docs

docs: $(DOCS_VENV)/.installed ## The documents as a site in .buildarena/docs, links checked
	@NO_MKDOCS_2_WARNING=1 $(DOCS_VENV)/bin/mkdocs build --quiet --clean

$(DOCS_VENV)/.installed: requirements-docs.lock $(STAMP)
	@bash mk/uv.sh venv --quiet --clear --python $(BIN)/python $(DOCS_VENV)
	@bash mk/uv.sh pip install --quiet --python $(DOCS_VENV)/bin/python --require-hashes -r requirements-docs.lock
	@touch $@
