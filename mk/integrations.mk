.PHONY: test-integrations check-integrations lock-integrations lock-uv inspect-tasks

# Adapters to frameworks, each with an environment of its own: the frameworks exclude each other.
INTEGRATIONS := inspect verifiers openenv gymnasium
LIBRARIES := libs/geometry libs/simulation libs/benchmark libs/environment
# What one of them needs besides: our workflows, which Inspect's models can play, and the client.
LIBRARIES_inspect := clients/python libs/besiege libs/store libs/pipeline services/worker
INTEGRATION_STAMPS := $(foreach name,$(INTEGRATIONS),.venv-integrations/$(name)/.installed)

test-integrations: check-integrations ## Each adapter against its real framework
	@bash mk/integrations.sh test $(INTEGRATIONS)

check-integrations: $(INTEGRATION_STAMPS)
	@bash mk/integrations.sh check $(INTEGRATIONS)

.venv-integrations/%/.installed: integrations/%/requirements.lock integrations/%/pyproject.toml $(STAMP)
	@bash mk/integrations.sh install $* $(LIBRARIES) $(LIBRARIES_$*)
	@touch $@

# Physics comes in the versions of requirements.lock: elsewhere the same trial has other bytes.
lock-integrations:
	@set -e; $(foreach name,$(INTEGRATIONS),bash mk/integrations.sh lock $(name) $(LIBRARIES) $(LIBRARIES_$(name));)
	@$(MAKE) --no-print-directory lock-uv

lock-uv: ## Writes the adapters' uv.lock from their requirements.lock
	@$(BIN)/python mk/uv_locks.py $(addprefix integrations/,$(INTEGRATIONS))

inspect-tasks: $(STAMP) ## Writes the tasks of Inspect's adapter and their versions again, after a change of tasks
	@$(BIN)/python mk/inspect_tasks.py
