.PHONY: bench-environment

bench-environment: $(STAMP) ## Measures building steps, branching and trials a second; JSON in .buildarena/
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m benchmarks.environment.bench_environment --json .buildarena/bench-environment.json
