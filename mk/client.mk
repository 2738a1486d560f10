SCHEMAS := clients/python/src/buildarena_client/schemas.py
.PHONY: client-schemas

client-schemas: $(SCHEMAS) ## Writes the Python client's types after the contract has changed

# Installations write them too; this is for a contract that changes later.
$(SCHEMAS): tests/data/openapi.json clients/python/hatch_build.py | $(STAMP)
	@$(BIN)/python clients/python/hatch_build.py

install check test: $(SCHEMAS)
