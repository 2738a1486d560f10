.PHONY: chaos

chaos: $(STAMP) ## Kills and restarts at full size; takes minutes
	@CHAOS_KILLS=20 $(BIN)/pytest tests/chaos -s --timeout 1800
