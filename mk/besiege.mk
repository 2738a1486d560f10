.PHONY: fuzz-besiege

FILES ?= 10000

fuzz-besiege: $(STAMP) ## Reads 10,000 damaged machine files of the game; each is refused or sound
	@PYTHONPATH=. $(BIN)/python tests/besiege/fuzz_files.py --files $(FILES)
