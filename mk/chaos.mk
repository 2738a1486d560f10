.PHONY: chaos

chaos: $(STAMP) ## Injects faults at full size; takes minutes
	@CHAOS_KILLS=20 CHAOS_PACKAGES=1000 CHAOS_PEOPLE=50 CHAOS_JOBS=2000 CHAOS_EVERY_S=5 CHAOS_LEASE_S=10 CHAOS_COMMANDS_S=60 $(BIN)/pytest scenarios/chaos -s --timeout 3600
