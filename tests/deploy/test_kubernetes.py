"""The manifests for Kubernetes: valid, and as closed as they say."""

import json
import os
import re
from ipaddress import ip_network
from pathlib import Path

import jsonschema
import kubernetes_validate
import pytest
import yaml
from support.documents.manifests import (
    KUBERNETES,
    OVERLAYS,
    config_of,
    kustomized,
    needs_kubectl,
    of_kind,
    pods,
    rendered,
)
from support.servers.prometheus import needs_promtool, promtool
from typer.main import get_command

from buildarena_backend import __version__
from buildarena_backend.catalog.models import load_registry
from buildarena_backend.database.roles import OWNER
from buildarena_backend.settings import ARTIFACT_CREDENTIALS, SECRETS, Settings
from buildarena_backend.states import CONSTRUCT_QUEUE, simulate_queue
from buildarena_backend.trials.installed_simulators import installed_engines
from buildarena_cli.commands import admin

SCHEMAS = json.loads((Path(__file__).parents[1] / "data/kubernetes-schemas.json").read_text())
"""Schemas of kinds that are not Kubernetes' own."""
ROLES = {"api": "api", "construct": "construct", "simulate-mujoco": "simulate"}
ROLES |= {"simulate-pybullet": "simulate"}
OURS = tuple(ROLES)
MAINTENANCE = {"backup": ["admin", "backup", "$(BACKUPS)"], "gc": ["admin", "gc"]}
COMPONENTS = ("gateway", "prometheus-operator", "models-in-cluster")


@pytest.fixture(params=[pytest.param(each, marks=needs_kubectl) for each in OVERLAYS])
def overlay(request) -> str:
    return request.param


@pytest.fixture
def documents(overlay) -> list[dict]:
    return rendered(overlay)


def check(document: dict) -> None:
    """Validates a document against Kubernetes' own schemas, or those of what extends it."""
    if document["kind"] in SCHEMAS:
        jsonschema.Draft202012Validator(SCHEMAS[document["kind"]]).validate(document)
        return
    for version in ("1.29", kubernetes_validate.latest_version()):
        kubernetes_validate.validate(document, version, strict=True)


def test_no_pod_has_more_rights_than_it_needs(documents) -> None:
    for name, pod in pods(documents).items():
        spec = pod["spec"]
        assert spec["automountServiceAccountToken"] is False, name
        assert spec["securityContext"]["runAsNonRoot"] is True, name
        assert spec["securityContext"]["runAsUser"] > 0, name
        assert spec["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
        assert not {"hostNetwork", "hostPID", "hostIPC", "hostAliases"} & set(spec), name
        assert not [volume for volume in spec["volumes"] if "hostPath" in volume]
        for container in [*spec["containers"], *spec.get("initContainers", [])]:
            assert container["securityContext"] == {
                "allowPrivilegeEscalation": False,
                "readOnlyRootFilesystem": True,
                "capabilities": {"drop": ["ALL"]},
            }, name
            assert container["resources"]["requests"].keys() == {"cpu", "memory"}, name
            assert "memory" in container["resources"]["limits"], name


def test_pods_mount_what_they_name_and_the_secrets_of_their_own_role(documents) -> None:
    claims = of_kind(documents, "PersistentVolumeClaim")
    for name, pod in pods(documents).items():
        spec = pod["spec"]
        volumes = {volume["name"]: volume for volume in spec["volumes"]}
        own = of_kind(documents, "StatefulSet").get(name, {}).get("spec", {})
        made = {claim["metadata"]["name"] for claim in own.get("volumeClaimTemplates", [])}
        (container,) = spec["containers"]
        mounted = {mount["name"]: mount["mountPath"] for mount in container["volumeMounts"]}
        assert set(mounted) == set(volumes) | made, name
        assert len(set(mounted.values())) == len(mounted)
        for volume in volumes.values():
            claim = volume.get("persistentVolumeClaim", {}).get("claimName")
            assert claim is None or claim in claims
        items = [volume.get("secret", {}).get("items", ()) for volume in volumes.values()]
        keys = {item["path"]: item["key"] for each in items for item in each}
        if name in {*OURS, "migrate", *MAINTENANCE}:
            assert keys["database_url"] == f"database_url_{ROLES.get(name, OWNER)}", name
        elif name != "roles":
            assert "database_url" not in keys, name
        for entry in container.get("env", []):
            if entry["name"].endswith("_FILE"):
                folder, _, file = entry["value"].rpartition("/")
                (at,) = [volume for volume, path in mounted.items() if path == folder]
                items = volumes[at]["secret"].get("items")
                assert items is None or file in {item["path"] for item in items}, entry


def test_no_environment_holds_a_secret_and_each_is_of_a_setting(documents) -> None:
    fields = {f"BUILDARENA_{name.upper()}" for name in Settings.model_fields}
    secret = {*(f"BUILDARENA_{name.upper()}" for name in SECRETS), *ARTIFACT_CREDENTIALS}
    secret -= {"BUILDARENA_ARTIFACTS_URL"}
    config = config_of(documents)["data"]
    assert set(config) - fields <= {"HOME", "AWS_ENDPOINT", "AWS_REGION"}
    for name in config.keys() & fields:
        Settings.model_validate({name.removeprefix("BUILDARENA_").lower(): config[name]})
    for network in filter(None, config["BUILDARENA_TRUSTED_PROXIES"].split(",")):
        assert ip_network(network).prefixlen >= 24, "no wide network is trusted"
    assert not of_kind(documents, "Secret")
    names = {name for each in of_kind(documents, "ConfigMap").values() for name in each["data"]}
    for pod in pods(documents).values():
        for container in pod["spec"]["containers"]:
            assert not [entry for entry in container.get("env", []) if "valueFrom" in entry]
            names |= {entry["name"] for entry in container.get("env", [])}
    assert not names & secret
    assert not [name for name in names if re.search("PASSWORD$|_KEY$|TOKEN$", name)]
    files = {f"{name}_FILE" for name in [*fields, *ARTIFACT_CREDENTIALS]}
    providers = {f"{each.key}_FILE" for each in load_registry().providers.values() if each.key}
    for name in OURS:
        given = {entry["name"] for entry in pods(documents)[name]["spec"]["containers"][0]["env"]}
        assert "BUILDARENA_DATABASE_URL_FILE" in given
        for key in ("ADMIN_KEY", "METRICS_KEY"):
            assert (f"BUILDARENA_{key}_FILE" in given) == (name == "api")
        keys = providers if name == "construct" else set()
        assert keys <= given <= files | keys, name


def test_workloads_have_their_image_and_are_stopped_and_moved_with_care(documents) -> None:
    found, budgets = pods(documents), of_kind(documents, "PodDisruptionBudget")
    assert {f"simulate-{engine}" for engine in installed_engines()} <= set(OURS)
    migrate = found["migrate"]["spec"]["containers"][0]
    assert migrate["image"] == f"buildarena/tools:{__version__}"
    assert migrate["args"] == ["admin", "migrate"]
    for name in OURS:
        pod = found[name]
        selector = budgets[name]["spec"]["selector"]["matchLabels"]
        assert selector.items() <= pod["metadata"]["labels"].items()
        (spread,) = pod["spec"]["topologySpreadConstraints"]
        assert spread["labelSelector"]["matchLabels"] == {"app.kubernetes.io/name": name}
        container = pod["spec"]["containers"][0]
        assert container["image"] == f"buildarena/{name}:{__version__}"
        assert "command" not in container
        # What starts has its own time; then a probe needs no delay.
        assert container["startupProbe"]["failureThreshold"] >= 60
        assert "initialDelaySeconds" not in container["livenessProbe"]
        assert ("readinessProbe" in container) == (name == "api")
        assert not [k for k, v in container.items() if k.endswith("Probe") and "tcpSocket" in v]
    api = found["api"]["spec"]["containers"][0]
    alive = api["livenessProbe"]["httpGet"]["path"]
    assert alive == "/openapi.json", "a lost database must not have the API killed"
    assert api["readinessProbe"]["httpGet"]["path"] == "/v1/health"


def test_nothing_goes_in_or_out_that_is_not_named(documents) -> None:
    policies = of_kind(documents, "NetworkPolicy")
    closed = policies["nothing"]["spec"]
    assert closed == {"podSelector": {}, "policyTypes": ["Ingress", "Egress"]}
    rules = [(n, one) for n, policy in policies.items() for one in policy["spec"].get("egress", [])]
    blocks = [
        (name, to.get("ipBlock", {}).get("cidr")) for name, rule in rules for to in rule["to"]
    ]
    everywhere = [name for name, cidr in blocks if cidr == "0.0.0.0/0"]
    assert everywhere == ["providers"]
    labels = {name: pod["metadata"]["labels"] for name, pod in pods(documents).items()}
    for policy in policies.values():
        wanted = policy["spec"]["podSelector"].get("matchLabels", {})
        assert any(wanted.items() <= given.items() for given in labels.values()), policy
        for rule in [*policy["spec"].get("egress", []), *policy["spec"].get("ingress", [])]:
            assert rule["ports"], policy
    stores = policies["stores-out"]["spec"]["podSelector"]["matchLabels"]
    reach = {name for name, given in labels.items() if stores.items() <= given.items()}
    assert reach == {*OURS, "migrate", *MAINTENANCE} | ({"roles"} & set(labels))


@needs_kubectl
@needs_promtool
def test_scaling_goes_by_figures_of_the_workers_own_queue(tmp_path) -> None:
    queues = {f"simulate-{engine}": simulate_queue(engine) for engine in installed_engines()}
    queues["construct"] = CONSTRUCT_QUEUE
    deployments = of_kind(rendered("external"), "Deployment")
    scaled = of_kind(rendered("external"), "ScaledObject", "HorizontalPodAutoscaler")
    assert set(scaled) == set(deployments)
    rules = []
    for name, each in scaled.items():
        assert each["spec"]["scaleTargetRef"]["name"] == name
        assert "replicas" not in deployments[name]["spec"]
        if each["kind"] == "ScaledObject":
            query = each["spec"]["triggers"][0]["metadata"]["query"]
            asked = [(f"buildarena_queue_{what}", queues[name]) for what in ("jobs", "running")]
            assert re.findall(r'(\w+){queue="([^"]+)"}', query) == asked
            rules.append({"record": f"x:{name.replace('-', '_')}", "expr": query})
    file = tmp_path / "queries.yml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "x", "rules": rules}]}))
    promtool("check", "rules", str(file))


def test_what_must_be_done_again_and_again_has_its_times(overlay, documents) -> None:
    found = of_kind(documents, "CronJob")
    assert set(found) == set(MAINTENANCE)
    assert len({each["spec"]["schedule"] for each in found.values()}) == len(found)
    for name, each in found.items():
        assert each["spec"]["concurrencyPolicy"] == "Forbid"
        (container,) = pods(documents)[name]["spec"]["containers"]
        assert container["args"] == MAINTENANCE[name]
        assert container["args"][1] in get_command(admin.app).commands
        given = {entry["name"]: entry["value"] for entry in container["env"]}
        mounts = {mount["mountPath"] for mount in container["volumeMounts"]}
        assert "/artifacts" in mounts or "AWS_SECRET_ACCESS_KEY_FILE" in given, overlay
        if name == "backup":
            artifacts = config_of(documents)["data"].get("BUILDARENA_ARTIFACTS_URL", "/artifacts")
            bucket = artifacts.removesuffix("/artifacts") or "/artifacts"
            assert not given["BACKUPS"].startswith(f"{bucket}/"), "apart from what it saves"
            assert given["BACKUPS"].startswith("s3://") or given["BACKUPS"] in mounts


def test_overlays_with_all_components_are_valid_and_lead_to_what_is(overlay, tmp_path) -> None:
    folder = KUBERNETES / "overlays" / overlay
    names = [KUBERNETES / "components" / name for name in COMPONENTS]
    added = {"components": [os.path.relpath(name, tmp_path) for name in names]}
    text = yaml.safe_dump({"resources": [os.path.relpath(folder, tmp_path)], **added})
    (tmp_path / "kustomization.yaml").write_text(text)
    documents = kustomized(tmp_path)
    for document in documents:
        check(document)
    for document in rendered(overlay):
        assert document["kind"] == "Namespace" or document["metadata"]["namespace"] == "buildarena"
    # A gateway takes the place of the ingress.
    assert not of_kind(documents, "Ingress")
    (route,) = of_kind(documents, "HTTPRoute").values()
    (rule,) = route["spec"]["rules"]
    (backend,) = rule["backendRefs"]
    (port,) = of_kind(documents, "Service")[backend["name"]]["spec"]["ports"]
    assert backend["port"] == port["port"]
    assert rule["timeouts"]["request"] == "0s", "streams stay open"
    policies = of_kind(documents, "NetworkPolicy")
    callers = policies["callers"]["spec"]["ingress"][0]["from"]
    spaces = [each["namespaceSelector"]["matchLabels"] for each in callers]
    parent = route["spec"]["parentRefs"][0]["namespace"]
    assert {"kubernetes.io/metadata.name": parent} in spaces
