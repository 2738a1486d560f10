.PHONY: bench-api

bench-api: $(STAMP) ## Measures the API's throughput; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.api.bench_api --json .buildarena/bench-api.json

.PHONY: bench-heavy

bench-heavy: $(STAMP) ## Measures a light question under a flood of heavy ones; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.api.bench_heavy --json .buildarena/bench-heavy.json

.PHONY: bench-drives

bench-drives: $(STAMP) ## Measures how soon keys move machines with one driver and with twenty; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.api.bench_drives --json .buildarena/bench-drives.json
