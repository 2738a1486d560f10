.PHONY: bench-cli

bench-cli: $(STAMP) ## Measures how long commands take beside `import typer, httpx`; JSON in .buildarena/
	@$(BIN)/python tests/benchmarks/cli/bench_cli.py --json .buildarena/bench-cli.json
