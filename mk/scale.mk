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
