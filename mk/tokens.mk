.PHONY: bench-tokens

bench-tokens: $(STAMP) ## Measures where a session's input tokens go; JSON in .buildarena/
	@$(BIN)/python tests/benchmarks/tokens/bench_tokens.py --json .buildarena/bench-tokens.json
