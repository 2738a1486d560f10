.PHONY: hunt

MINUTES ?= 60
HUNT_SEED ?= 0

hunt: $(STAMP) ## Searches for machines that score without building what is asked; MINUTES=60
	@OMP_NUM_THREADS=1 $(BIN)/python tests/hunt/hunt.py --minutes $(MINUTES) --seed $(HUNT_SEED)
