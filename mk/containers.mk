.PHONY: test-containers

test-containers: $(STAMP) ## Builds the images and uses the compose file as an operator does; root, Docker, ~10 min, the second time ~5
	@$(TEST_PYTHON) -m scenarios.containers.run --json .buildarena/test-containers.json $(if $(KEEP),--keep)
