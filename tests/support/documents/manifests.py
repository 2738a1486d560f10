"""Kubernetes' manifests as `kubectl kustomize` renders them."""

import re
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.programs import captured

KUBERNETES = Path(__file__).resolve().parents[3] / "deploy" / "kubernetes"
KUBECTL = shutil.which("kubectl")
OVERLAYS = ("small", "external")

needs_kubectl = pytest.mark.skipif(
    KUBECTL is None, reason="overlays are rendered by kubectl (1.22 or later), which is not here"
)


def read(text: str) -> list[dict[str, Any]]:
    """The documents of a file."""
    return [document for document in yaml.safe_load_all(text) if document]


@cache
def rendered(overlay: str) -> list[dict[str, Any]]:
    """What an overlay would apply."""
    return kustomized(KUBERNETES / "overlays" / overlay)


def kustomized(folder: Path) -> list[dict[str, Any]]:
    """What the kustomization in a folder would apply."""
    done = captured([str(KUBECTL), "kustomize", str(folder)], within_s=60)
    assert done.returncode == 0, done.stderr
    assert not done.stderr, "kustomize warns of what it will not take one day"
    return read(done.stdout)


def of_kind(documents: list[dict[str, Any]], *kinds: str) -> dict[str, dict[str, Any]]:
    """Documents of some kinds by name."""
    return {each["metadata"]["name"]: each for each in documents if each["kind"] in kinds}


def config_of(documents: list[dict[str, Any]], name: str = "buildarena") -> dict[str, Any]:
    """The ConfigMap of a name, which ends in a checksum."""
    found = of_kind(documents, "ConfigMap")
    (config,) = (each for full, each in found.items() if re.fullmatch(rf"{name}-\w{{10}}", full))
    return config


def pods(documents: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """What each workload's pods are, by the name that its pods have as a label."""
    found = of_kind(documents, "Deployment", "StatefulSet", "Job").values()
    templates = [each["spec"]["template"] for each in found]
    crons = of_kind(documents, "CronJob").values()
    templates += [each["spec"]["jobTemplate"]["spec"]["template"] for each in crons]
    return {each["metadata"]["labels"]["app.kubernetes.io/name"]: each for each in templates}
