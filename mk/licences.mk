.PHONY: licences

licences: $(STAMP) ## Licences and pins of everything we depend on, as a table; exit code 1 where one is not known
	@$(BIN)/python mk/licences.py
