.PHONY: gameday

GAMEDAY_JOBS ?= 2000
GAMEDAY_MINUTES ?= 60

gameday: $(STAMP) ## An hour with twelve faults under 2,000 jobs: who was told, when, and the books; root, Prometheus, Alertmanager
	@$(TEST_PYTHON) -m scenarios.gameday.run --jobs $(GAMEDAY_JOBS) --minutes $(GAMEDAY_MINUTES) --json .buildarena/gameday.json
