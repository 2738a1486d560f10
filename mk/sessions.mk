.PHONY: bench-sessions

bench-sessions: $(STAMP) ## 200 sessions at once in one construct process
	@$(BIN)/python tests/benchmarks/sessions/bench_sessions.py
