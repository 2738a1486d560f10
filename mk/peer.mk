.PHONY: peer

peer: $(STAMP) ## Plays a session against litellm's proxy
	@[ -x .venv-peer/bin/litellm ] || { bash mk/uv.sh venv --quiet --python $(BIN)/python .venv-peer && \
		bash mk/uv.sh pip install --quiet --python .venv-peer/bin/python "litellm[proxy]==1.106.2"; }
	@$(TEST_PYTHON) -m scenarios.peer.check_litellm .venv-peer/bin/litellm
