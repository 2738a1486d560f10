.PHONY: check-integrations lock-integrations

# Adapters to frameworks, each with its own environment: the frameworks exclude each other.
INTEGRATIONS := inspect verifiers gymnasium
LIBRARIES := libs/geometry libs/simulation libs/benchmark
# Additional packages for Inspect: the workflows, which its models can play, and the client.
LIBRARIES_inspect := clients/python libs/besiege libs/backend services/worker
INTEGRATION_STAMPS := $(foreach name,$(INTEGRATIONS),.venv-integrations/$(name)/.installed)

check-integrations: $(INTEGRATION_STAMPS)
	@bash mk/integrations.sh check $(INTEGRATIONS)

# Data of adapters and their tests, computed from the worker's designs.
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

# Physics has the versions of requirements.lock, because others change a trial's bytes.
lock-integrations:
	@set -e; $(foreach name,$(INTEGRATIONS),bash mk/integrations.sh lock $(name) $(LIBRARIES) $(LIBRARIES_$(name));)
