.PHONY: bench-statistics

bench-statistics: $(STAMP) ## Measures coverage of intervals and false claims of boards; JSON in .buildarena/
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m benchmarks.statistics.bench_statistics --json .buildarena/bench-statistics.json
