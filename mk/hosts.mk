.PHONY: test-hosts

test-hosts: MINUTES := $(if $(filter command line environment,$(origin MINUTES)),$(MINUTES),10)
test-hosts: SEED ?= 18
test-hosts: $(STAMP) ## Five network namespaces as hosts whose links are slow and cut at random; MINUTES=10, SEED; root
	@$(TEST_PYTHON) -m scenarios.hosts.run --minutes $(MINUTES) --seed $(SEED) --json .buildarena/test-hosts.json
