.PHONY: test-containers

test-containers: $(STAMP) ## Builds the images and uses the compose file as an operator does; root, Docker, ~15 min
	@cd tests/containers && ../../$(BIN)/python run.py --json ../../.buildarena/test-containers.json $(if $(KEEP),--keep)
