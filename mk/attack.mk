.PHONY: attack

attack: $(STAMP) ## Everything an adversary tries, and what others notice of it; JSON in .buildarena/
	@$(TEST_PYTHON) -m scenarios.attack.run --json .buildarena/attack.json
