.PHONY: bench-simulation

bench-simulation: $(STAMP) ## Measures the simulation and the engines' agreement; JSON in .buildarena/
	@$(BIN)/python tests/benchmarks/simulation/bench_simulation.py --json .buildarena/bench-simulation.json
