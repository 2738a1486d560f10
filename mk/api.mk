.PHONY: bench-api

bench-api: $(STAMP) ## Measures the API's throughput; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.api.bench_api --json .buildarena/bench-api.json
