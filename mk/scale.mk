.PHONY: bench-scale

SCALE_JOBS ?= 1000000

bench-scale: $(STAMP) ## Measures boards, lists, claims and a large sweep at 1,000,000 jobs; JSON in .buildarena/
	@PYTHONPATH=tests/support $(BIN)/python tests/benchmarks/scale/bench_scale.py --jobs $(SCALE_JOBS) --json .buildarena/bench-scale.json
