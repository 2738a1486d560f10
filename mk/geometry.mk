.PHONY: bench-geometry

bench-geometry: $(STAMP) ## Measures the geometry library; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.geometry.bench_geometry --json .buildarena/bench-geometry.json
