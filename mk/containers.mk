.PHONY: test-containers test-image-openenv

test-containers: $(STAMP) ## Builds the images and uses the compose file as an operator does; root, Docker, ~10 min, the second time ~5
	@$(TEST_PYTHON) -m scenarios.containers.run --json .buildarena/test-containers.json $(if $(KEEP),--keep)

test-image-openenv: .venv-integrations/openenv/.installed ## Builds the OpenEnv server's image, runs it and plays with it; root, Docker, ~5 min
	@$(TEST_PYTHON) -m scenarios.containers.openenv
