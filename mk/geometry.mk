.PHONY: bench-geometry geometry-pictures

bench-geometry: $(STAMP) ## Measures the geometry library; JSON in .buildarena/
	@$(BIN)/python tests/benchmarks/geometry/bench_geometry.py --json .buildarena/bench-geometry.json

geometry-pictures: $(STAMP) ## Draws the pictures of the geometry guide again
	@$(BIN)/python examples/geometry/draw_guide.py docs/geometry
