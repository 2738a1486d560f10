.PHONY: learn

LEARN_TASK ?= support-1
LEARN_SEED ?= 0
LEARN_UPDATES ?= 40

learn: .venv-integrations/verifiers/.installed ## A small policy learns by GRPO; LEARN_TASK=support-1 or balance-1, LEARN_SEED, LEARN_UPDATES
	@.venv-integrations/verifiers/bin/python examples/learning/grpo/train.py --task $(LEARN_TASK) --seed $(LEARN_SEED) \
		--updates $(LEARN_UPDATES) --out .buildarena/learning/$(LEARN_TASK).seed-$(LEARN_SEED)
