.PHONY: bench-leaderboard

bench-leaderboard: $(STAMP) ## Measures the leaderboard at 100,000 jobs; JSON in .buildarena/
	@PYTHONPATH=tests/support $(BIN)/python tests/benchmarks/leaderboard/bench_leaderboard.py --json .buildarena/bench-leaderboard.json
