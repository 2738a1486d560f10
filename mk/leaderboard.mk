.PHONY: bench-leaderboard

bench-leaderboard: $(STAMP) ## Measures the leaderboard at 100,000 jobs; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.leaderboard.bench_leaderboard --json .buildarena/bench-leaderboard.json
