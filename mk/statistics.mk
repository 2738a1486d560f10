.PHONY: bench-statistics

bench-statistics: $(STAMP) ## Measures coverage of intervals and false claims of boards; JSON in .buildarena/
	@OMP_NUM_THREADS=1 PYTHONPATH=tests/support $(BIN)/python tests/benchmarks/statistics/bench_statistics.py --json .buildarena/bench-statistics.json
