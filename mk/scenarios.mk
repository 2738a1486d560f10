.PHONY: attack

attack: $(STAMP) ## Everything an adversary tries, and what others notice of it; JSON in .buildarena/
	@$(TEST_PYTHON) -m scenarios.attack.run --json .buildarena/attack.json

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

.PHONY: chaos

chaos: $(STAMP) ## Injects faults at full size; takes minutes
	@CHAOS_KILLS=20 CHAOS_PACKAGES=1000 CHAOS_PEOPLE=50 CHAOS_JOBS=2000 CHAOS_EVERY_S=5 CHAOS_LEASE_S=10 CHAOS_COMMANDS_S=60 $(BIN)/pytest scenarios/chaos -s --timeout 3600

.PHONY: test-containers test-image-openenv

test-containers: $(STAMP) ## Builds the images and uses the compose file as an operator does; root, Docker, ~10 min, the second time ~5
	@$(TEST_PYTHON) -m scenarios.containers.run --json .buildarena/test-containers.json $(if $(KEEP),--keep)

test-image-openenv: .venv-integrations/openenv/.installed ## Builds the OpenEnv server's image, runs it and plays with it; root, Docker, ~5 min
	@$(TEST_PYTHON) -m scenarios.containers.openenv

.PHONY: gameday

GAMEDAY_JOBS ?= 2000
GAMEDAY_MINUTES ?= 60

gameday: $(STAMP) ## An hour with twelve faults under 2,000 jobs: who was told, when, and the books; root, Prometheus, Alertmanager
	@$(TEST_PYTHON) -m scenarios.gameday.run --jobs $(GAMEDAY_JOBS) --minutes $(GAMEDAY_MINUTES) --json .buildarena/gameday.json

.PHONY: test-hosts

test-hosts: MINUTES := $(if $(filter command line environment,$(origin MINUTES)),$(MINUTES),10)
test-hosts: SEED ?= 18
test-hosts: $(STAMP) ## Five network namespaces as hosts whose links are slow and cut at random; MINUTES=10, SEED; root
	@$(TEST_PYTHON) -m scenarios.hosts.run --minutes $(MINUTES) --seed $(SEED) --json .buildarena/test-hosts.json

.PHONY: hunt

MINUTES ?= 60
HUNT_SEED ?= 0
HUNTING := $(VENV)/.hunting

hunt: $(HUNTING) ## Searches for machines that score without building what is asked; MINUTES=60
	@OMP_NUM_THREADS=1 $(TEST_PYTHON) -m scenarios.hunt.run --minutes $(MINUTES) --seed $(HUNT_SEED)

test-nightly: $(HUNTING)

# The search's library brings 80 MB along, which nobody needs who does not hunt.
$(HUNTING): $(STAMP)
	@bash mk/install_tool.sh $(BIN)/python ribs
	@touch $@

.PHONY: learn

LEARN_TASK ?= support-1
LEARN_SEED ?= 0
LEARN_UPDATES ?= 40

learn: .venv-integrations/verifiers/.installed ## A small policy learns by GRPO; LEARN_TASK=support-1 or balance-1, LEARN_SEED, LEARN_UPDATES
	@.venv-integrations/verifiers/bin/python examples/learning/grpo/train.py --task $(LEARN_TASK) --seed $(LEARN_SEED) \
		--updates $(LEARN_UPDATES) --out .buildarena/learning/$(LEARN_TASK).seed-$(LEARN_SEED)

.PHONY: peer

peer: $(STAMP) ## Plays a session against litellm's proxy
	@[ -x .venv-peer/bin/litellm ] || { bash mk/uv.sh venv --quiet --python $(BIN)/python .venv-peer && \
		bash mk/uv.sh pip install --quiet --python .venv-peer/bin/python "litellm[proxy]==1.106.2"; }
	@$(TEST_PYTHON) -m scenarios.peer.check_litellm .venv-peer/bin/litellm

.PHONY: soak

SOAK_S ?= 3600
SOAK_JOBS ?= 20000

soak: $(STAMP) ## 20,000 short jobs with kills every 10 s for an hour: books, memory; JSON in .buildarena/
	@$(TEST_PYTHON) -m scenarios.soak.run --seconds $(SOAK_S) --jobs $(SOAK_JOBS) --json .buildarena/soak.json
