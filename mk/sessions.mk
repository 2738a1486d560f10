.PHONY: bench-sessions

bench-sessions: $(STAMP) ## Measures 200 sessions at once in one construct process
	@$(BIN)/python tests/benchmarks/sessions/bench_sessions.py
