.PHONY: bench-api

bench-api: $(STAMP) ## Measures the API's throughput; JSON in .buildarena/
	@$(BIN)/python tests/benchmarks/api/bench_api.py --json .buildarena/bench-api.json
