CLIENT := clients/python
.PHONY: client-modules

client-modules: $(STAMP) ## Writes what of the Python client follows from the contract and from itself
	@$(BIN)/python $(CLIENT)/generate/schemas.py tests/data/openapi.json > $(CLIENT)/src/buildarena_client/schemas.py.new
	@mv $(CLIENT)/src/buildarena_client/schemas.py.new $(CLIENT)/src/buildarena_client/schemas.py
	@$(BIN)/python $(CLIENT)/generate/async_client.py
