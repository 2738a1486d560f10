.PHONY: bench-geometry geometry-pictures module-guide

bench-geometry: $(STAMP) ## Measures the geometry library; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.geometry.bench_geometry --json .buildarena/bench-geometry.json

geometry-pictures: $(STAMP) ## Draws the pictures of the geometry guide again
	@$(BIN)/python examples/geometry/draw_guide.py docs/geometry

module-guide: $(STAMP) ## Writes docs/modules.md and its pictures again, after a change of the module files
	@$(BIN)/python examples/geometry/describe_modules.py docs
