.PHONY: bench-tokens

bench-tokens: $(STAMP) ## Measures where a session's input tokens go; JSON in .buildarena/
	@$(BIN)/python tests/benchmarks/tokens/bench_tokens.py --json .buildarena/bench-tokens.json

.PHONY: what-a-model-sees

what-a-model-sees: $(STAMP) ## Writes docs/what-a-model-sees.md again, after an intended change
	@PYTHONPATH=tests/support $(BIN)/python tests/support/what_a_model_sees.py
