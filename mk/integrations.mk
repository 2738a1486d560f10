.PHONY: check-integrations lock-integrations

# Adapters to frameworks, each with an environment of its own: the frameworks exclude each other.
INTEGRATIONS := inspect verifiers gymnasium
LIBRARIES := libs/geometry libs/simulation libs/benchmark
# What one of them needs besides: our workflows, which Inspect's models can play, and the client.
LIBRARIES_inspect := clients/python libs/besiege libs/backend services/worker
INTEGRATION_STAMPS := $(foreach name,$(INTEGRATIONS),.venv-integrations/$(name)/.installed)

check-integrations: $(INTEGRATION_STAMPS)
	@bash mk/integrations.sh check $(INTEGRATIONS)

# What adapters have or test with, and only the worker's designs tell.
EXPERT_CALLS := build/expert_calls.json
DRIVEN := integrations/gymnasium/src/buildarena_gymnasium/machines.json
DESIGNS := $(wildcard libs/benchmark/src/buildarena_benchmark/tasks/*/expert.py)

$(EXPERT_CALLS): tests/support/machines/expert_calls.py $(DESIGNS) $(STAMP)
	@mkdir -p $(@D)
	@$(TEST_PYTHON) -m support.machines.expert_calls $@

$(DRIVEN): tests/support/machines/drive_machines.py $(DESIGNS) $(STAMP)
	@$(TEST_PYTHON) -m support.machines.drive_machines

check-integrations: $(EXPERT_CALLS) $(DRIVEN)

release: $(DRIVEN)

.venv-integrations/%/.installed: integrations/%/requirements.lock integrations/%/pyproject.toml $(STAMP)
	@bash mk/integrations.sh install $* $(LIBRARIES) $(LIBRARIES_$*)
	@touch $@

# Physics comes in the versions of requirements.lock: elsewhere the same trial has other bytes.
lock-integrations:
	@set -e; $(foreach name,$(INTEGRATIONS),bash mk/integrations.sh lock $(name) $(LIBRARIES) $(LIBRARIES_$(name));)
