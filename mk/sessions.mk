.PHONY: bench-sessions bench-sessions-1000 bench-job bench-requests

bench-sessions: $(STAMP) ## Measures 200 sessions at once in one construct process
	@$(TEST_PYTHON) -m benchmarks.sessions.bench_sessions

bench-sessions-1000: $(STAMP) ## Measures 1,000 sessions of a model that takes 5 s in one construct process; 4 min
	@$(TEST_PYTHON) -m benchmarks.sessions.bench_sessions --sessions 1000 --latency 5 --json .buildarena/bench-sessions-1000.json

bench-requests: $(STAMP) ## Measures what a model request costs over aiohttp and over httpx2
	@$(TEST_PYTHON) -m benchmarks.sessions.bench_requests --json .buildarena/bench-requests.json

bench-job: $(STAMP) ## Measures what a job costs beside its session and its simulation
	@$(TEST_PYTHON) -m benchmarks.sessions.bench_job --json .buildarena/bench-job.json
