.PHONY: bench-api

bench-api: $(STAMP) ## Measures the API's throughput; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.api.bench_api --json .buildarena/bench-api.json

.PHONY: bench-heavy

bench-heavy: $(STAMP) ## Measures a light question under a flood of heavy ones; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.api.bench_heavy --json .buildarena/bench-heavy.json

.PHONY: bench-drives

bench-drives: $(STAMP) ## Measures how soon keys move machines with one driver and with twenty; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.api.bench_drives --json .buildarena/bench-drives.json

.PHONY: bench-cli

bench-cli: $(STAMP) ## Measures how long commands take beside `import typer, httpx`; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.cli.bench_cli --json .buildarena/bench-cli.json

.PHONY: bench-environment

bench-environment: $(STAMP) ## Measures building steps, branching and trials a second; JSON in .buildarena/
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m benchmarks.environment.bench_environment --json .buildarena/bench-environment.json

.PHONY: bench-leaderboard

bench-leaderboard: $(STAMP) ## Measures the leaderboard at 100,000 jobs; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.leaderboard.bench_leaderboard --json .buildarena/bench-leaderboard.json

.PHONY: bench-scale

SCALE_JOBS ?= 1000000

bench-scale: $(STAMP) ## Measures boards, lists, claims and a large sweep at 1,000,000 jobs; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.scale.bench_scale --jobs $(SCALE_JOBS) --json .buildarena/bench-scale.json

.PHONY: bench-heartbeats

bench-heartbeats: $(STAMP) ## What heartbeats cost Postgres, for one worker and for a hundred
	@$(TEST_PYTHON) -m benchmarks.scale.bench_heartbeats --json .buildarena/bench-heartbeats.json

.PHONY: bench-idle

bench-idle: $(STAMP) ## What each process of a service costs while there is nothing to do; five minutes
	@$(TEST_PYTHON) -m benchmarks.idle.bench_idle --json .buildarena/bench-idle.json

.PHONY: bench-histories

bench-histories: $(STAMP) ## Packing of old jobs in a database with 10,000,000 rows; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.scale.bench_histories --json .buildarena/bench-histories.json

.PHONY: bench-sessions bench-sessions-1000 bench-job bench-requests

bench-sessions: $(STAMP) ## Measures 200 sessions at once in one construct process
	@$(TEST_PYTHON) -m benchmarks.sessions.bench_sessions

bench-sessions-1000: $(STAMP) ## Measures 1,000 sessions of a model that takes 5 s in one construct process; 4 min
	@$(TEST_PYTHON) -m benchmarks.sessions.bench_sessions --sessions 1000 --latency 5 --json .buildarena/bench-sessions-1000.json

bench-requests: $(STAMP) ## Measures what a model request costs over aiohttp and over httpx2
	@$(TEST_PYTHON) -m benchmarks.sessions.bench_requests --json .buildarena/bench-requests.json

bench-job: $(STAMP) ## Measures what a job costs beside its session and its simulation
	@$(TEST_PYTHON) -m benchmarks.sessions.bench_job --json .buildarena/bench-job.json

.PHONY: bench-simulation bench-agreement bench-agreement-workshop bench-agreement-throwing bench-processors bench-control bench-worlds bench-ceilings bench-repeats bench-trials

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

bench-control: $(STAMP) ## What a controller costs: a tick, and a trial beside one by keys
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_control --json .buildarena/bench-control.json

bench-worlds: $(STAMP) ## Who passes in fifty drawn worlds of each task for programs; half an hour
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_worlds --json .buildarena/bench-worlds.json

bench-ceilings: $(STAMP) ## How much room indicators leave above the expert and three first tries
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_ceilings --json .buildarena/bench-ceilings.json

bench-repeats: $(STAMP) ## Whether 200 trials with programs repeat to the byte, and how far engines' senses are apart
	@$(TEST_PYTHON) -m benchmarks.simulation.bench_repeats --json .buildarena/bench-repeats.json

.PHONY: bench-costs sizing

bench-costs: $(STAMP) ## Measures what a turn and a job cost each part of the service; six minutes
	@$(TEST_PYTHON) -m benchmarks.sizing.costs --json .buildarena/costs.json

sizing: $(STAMP) ## What 10, 1,000 and 100,000 sessions at once need, by the measured costs
	@$(TEST_PYTHON) -m benchmarks.sizing.sizing_model $(if $(wildcard .buildarena/costs.json),--costs .buildarena/costs.json)

.PHONY: bench-statistics

bench-statistics: $(STAMP) ## Measures coverage of intervals and false claims of boards; JSON in .buildarena/
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m benchmarks.statistics.bench_statistics --json .buildarena/bench-statistics.json

.PHONY: bench-separation

bench-separation: $(STAMP) ## Measures on how many tasks boards tell three models apart; JSON in .buildarena/
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m benchmarks.statistics.bench_separation --json .buildarena/bench-separation.json

.PHONY: bench-tokens

bench-tokens: $(STAMP) ## Measures where a session's input tokens go; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.tokens.bench_tokens --json .buildarena/bench-tokens.json

.PHONY: kept-sessions

kept-sessions: $(STAMP) ## Writes tests/data/sessions.json again, after an intended change of what models read
	@$(TEST_PYTHON) -m support.documents.kept_sessions

.PHONY: bench-geometry

bench-geometry: $(STAMP) ## Measures the geometry library; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.geometry.bench_geometry --json .buildarena/bench-geometry.json
