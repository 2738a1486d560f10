.PHONY: hunt

MINUTES ?= 60
HUNT_SEED ?= 0
HUNTING := $(VENV)/.hunting

hunt: $(HUNTING) ## Searches for machines that score without building what is asked; MINUTES=60
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m scenarios.hunt.run --minutes $(MINUTES) --seed $(HUNT_SEED)

test test-slow test-long: $(HUNTING)

# The search's library brings 80 MB along, which nobody needs who does not hunt.
$(HUNTING): requirements-hunt.lock $(STAMP)
	@bash mk/uv.sh pip install --quiet --python $(BIN)/python --require-hashes -r requirements-hunt.lock
	@touch $@
