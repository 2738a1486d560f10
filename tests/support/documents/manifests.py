"""Kubernetes' manifests as `kubectl kustomize` renders them."""

import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml

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
    done = subprocess.run(
        [str(KUBECTL), "kustomize", str(KUBERNETES / "overlays" / overlay)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr, "kustomize warns of what it will not take one day"
    return read(done.stdout)


def of_kind(documents: list[dict[str, Any]], *kinds: str) -> dict[str, dict[str, Any]]:
    """Documents of some kinds by name."""
    return {each["metadata"]["name"]: each for each in documents if each["kind"] in kinds}


def pods(documents: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """What each workload's pods are, by its name."""
    found = of_kind(documents, "Deployment", "StatefulSet", "Job")
    return {name: each["spec"]["template"] for name, each in found.items()}
