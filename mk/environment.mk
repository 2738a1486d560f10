.PHONY: bench-environment

bench-environment: $(STAMP) ## Measures building steps, branching and trials a second; JSON in .buildarena/
	@OMP_NUM_THREADS=1 $(BIN)/python tests/benchmarks/environment/bench_environment.py --json .buildarena/bench-environment.json
