.PHONY: fuzz-besiege besiege besiege-faults besiege-games

FILES ?= 10000
FAULTY_RUNS ?= 200
GAME_TESTS := services/simworker-besiege/tests

fuzz-besiege: $(STAMP) ## Reads, writes and reads again 10,000 damaged machine files; each is refused or whole
	@PYTHONPATH=.:tests $(BIN)/python tests/besiege/fuzz_files.py --files $(FILES)

besiege: $(STAMP) ## All nine tasks through the stand-in game's window, and 20 killed runners
	@BESIEGE_TASKS=all BESIEGE_KILLS=20 $(BIN)/pytest -n 2 --timeout=900 $(GAME_TESTS)/test_end_to_end.py $(GAME_TESTS)/test_killed_runner.py

besiege-faults: $(STAMP) ## 200 runs in a stand-in game that misbehaves at random; half an hour
	@PYTHONPATH=tests:$(GAME_TESTS)/support $(BIN)/python $(GAME_TESTS)/many_faulty_runs.py --runs $(FAULTY_RUNS) --json .buildarena/besiege-faults.json

besiege-games: $(STAMP) ## Records again what the stand-in game says, after an intended change of tasks, exports or physics
	@PYTHONPATH=tests:$(GAME_TESTS)/support $(BIN)/python -m record_games
