.PHONY: bench-simulation bench-agreement bench-agreement-workshop bench-processors

bench-simulation: $(STAMP) ## Measures the simulation and the engines' agreement; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_simulation --json .buildarena/bench-simulation.json

bench-agreement: $(STAMP) ## Compares the engines on 300 machines that nobody chose; 10 minutes
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_agreement --json .buildarena/bench-agreement.json

bench-agreement-workshop: $(STAMP) ## The same for 120 machines of the workshop's modules
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_agreement --set workshop \
		--json .buildarena/bench-agreement-workshop.json

bench-processors: $(STAMP) ## Compares 200 trials' bytes over kinds of processors; an hour
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_processors --json .buildarena/bench-processors.json
