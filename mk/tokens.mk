.PHONY: bench-tokens

bench-tokens: $(STAMP) ## Measures where a session's input tokens go; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.tokens.bench_tokens --json .buildarena/bench-tokens.json

.PHONY: kept-sessions

kept-sessions: $(STAMP) ## Writes tests/data/sessions.json again, after an intended change of what models read
	@$(TEST_PYTHON) -m support.documents.kept_sessions
