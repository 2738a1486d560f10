.PHONY: bench-costs sizing

bench-costs: $(STAMP) ## Measures what a turn and a job cost each part of the service; six minutes
	@$(TEST_PYTHON) -m benchmarks.sizing.costs --json .buildarena/costs.json

sizing: $(STAMP) ## What 10, 1,000 and 100,000 sessions at once need, by the measured costs
	@$(TEST_PYTHON) -m benchmarks.sizing.sizing_model $(if $(wildcard .buildarena/costs.json),--costs .buildarena/costs.json)
