.PHONY: attack

attack: $(STAMP) ## Everything an adversary tries, and what others notice of it; JSON in .buildarena/
	@$(BIN)/python tests/attack/attack.py --json .buildarena/attack.json
