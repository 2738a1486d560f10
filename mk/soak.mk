.PHONY: soak

SOAK_S ?= 3600
SOAK_JOBS ?= 20000

soak: $(STAMP) ## 20,000 short jobs with kills every 10 s for an hour: books, memory; JSON in .buildarena/
	@$(TEST_PYTHON) -m scenarios.soak.run --seconds $(SOAK_S) --jobs $(SOAK_JOBS) --json .buildarena/soak.json
