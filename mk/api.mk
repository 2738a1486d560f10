.PHONY: bench-api

bench-api: $(STAMP) ## What the API carries; JSON in .buildarena/
	@$(BIN)/python tests/benchmarks/api/bench_api.py --json .buildarena/bench-api.json
