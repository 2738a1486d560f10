.PHONY: peer

peer: $(STAMP) ## A session against litellm's proxy, a server that nobody here wrote
	@[ -x .venv-peer/bin/litellm ] || { $(PYTHON) -m uv venv --quiet --python $(PYTHON) .venv-peer && \
		$(PYTHON) -m uv pip install --quiet --python .venv-peer/bin/python "litellm[proxy]==1.106.2"; }
	@$(BIN)/python tests/peer/check_litellm.py .venv-peer/bin/litellm
