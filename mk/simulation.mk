.PHONY: bench-simulation bench-agreement bench-agreement-workshop bench-agreement-throwing bench-processors bench-game bench-control bench-worlds bench-ceilings bench-repeats bench-trials \
	game-evidence evidence-machines

bench-simulation: $(STAMP) ## Measures the simulation and the engines' agreement; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_simulation --json .buildarena/bench-simulation.json

bench-trials: $(STAMP) ## Measures whole trials, many of one machine, and those with controllers; five minutes
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_trials --json .buildarena/bench-trials.json

bench-agreement: $(STAMP) ## Compares the engines on 300 machines that nobody chose; 10 minutes
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_agreement --json .buildarena/bench-agreement.json

bench-agreement-workshop: $(STAMP) ## The same for 120 machines of the workshop's modules
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_agreement --set workshop \
		--json .buildarena/bench-agreement-workshop.json

bench-agreement-throwing: $(STAMP) ## The same for 120 catapults
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_agreement --set throwing \
		--json .buildarena/bench-agreement-throwing.json

bench-processors: $(STAMP) ## Compares 200 trials' bytes over kinds of processors; an hour
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_processors --json .buildarena/bench-processors.json

bench-game: $(STAMP) ## What published trials in the real game say beside our engines
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_game --json .buildarena/bench-game.json

bench-control: $(STAMP) ## What a controller costs: a tick, and a trial beside one by keys
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_control --json .buildarena/bench-control.json

bench-worlds: $(STAMP) ## Who passes in fifty drawn worlds of each task for programs; half an hour
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_worlds --json .buildarena/bench-worlds.json

bench-ceilings: $(STAMP) ## How much room indicators leave above the expert and three first tries
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_ceilings --json .buildarena/bench-ceilings.json

bench-repeats: $(STAMP) ## Whether 200 trials with programs repeat to the byte, and how far engines' senses are apart
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_repeats --json .buildarena/bench-repeats.json

game-evidence: $(STAMP) ## Writes the tables of assumptions and of agreement with the game in the documents
	@$(TEST_PYTHON) -m benchmarks.simulation.game_evidence

evidence-machines: $(STAMP) ## Writes the machines of a first evening with the game, after a change of the expert
	@$(TEST_PYTHON) -m support.machines.evidence
