.PHONY: bench-statistics

bench-statistics: $(STAMP) ## Measures coverage of intervals and false claims of boards; JSON in .buildarena/
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m benchmarks.statistics.bench_statistics --json .buildarena/bench-statistics.json

.PHONY: bench-separation

bench-separation: $(STAMP) ## Measures on how many tasks boards tell three models apart; JSON in .buildarena/
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m benchmarks.statistics.bench_separation --json .buildarena/bench-separation.json
