.PHONY: bench-simulation bench-agreement

bench-simulation: $(STAMP) ## Measures the simulation and the engines' agreement; JSON in .buildarena/
	@$(BIN)/python tests/benchmarks/simulation/bench_simulation.py --json .buildarena/bench-simulation.json

bench-agreement: $(STAMP) ## Compares the engines on 300 machines that nobody chose; 10 minutes
	@$(BIN)/python tests/benchmarks/simulation/bench_agreement.py --json .buildarena/bench-agreement.json
