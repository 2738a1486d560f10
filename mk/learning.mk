.PHONY: learn

LEARN_SEED ?= 0
LEARN_UPDATES ?= 60

learn: LEARN_TASK ?= support-1
learn: .venv-integrations/verifiers/.installed ## A small policy learns a task by GRPO; LEARN_TASK=support-1 or balance-1, LEARN_SEED=0
	@.venv-integrations/verifiers/bin/python examples/learning/grpo/train.py --task $(LEARN_TASK) --seed $(LEARN_SEED) \
		--updates $(LEARN_UPDATES) --out .buildarena/learning/$(LEARN_TASK).seed-$(LEARN_SEED)
