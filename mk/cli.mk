.PHONY: bench-cli

bench-cli: $(STAMP) ## Measures how long commands take beside `import typer, httpx`; JSON in .buildarena/
	@$(TEST_PYTHON) -m benchmarks.cli.bench_cli --json .buildarena/bench-cli.json
