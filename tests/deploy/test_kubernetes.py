"""The manifests for Kubernetes: valid, and as closed as they say."""

import json
import os
import re
from pathlib import Path
from urllib.parse import urlsplit

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
    read,
    rendered,
)
from support.documents.promtool import needs_promtool, promtool

from buildarena_cli.command_table import ADMIN
from buildarena_pipeline import __version__
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.runtime.settings import ARTIFACT_CREDENTIALS, SECRETS, Settings
from buildarena_pipeline.runtime.simulators.installed import installed_engines
from buildarena_store.states import CONSTRUCT_QUEUE, simulate_queue

SCHEMAS = json.loads((Path(__file__).parents[1] / "data/kubernetes-schemas.json").read_text())
"""Schemas of kinds that are not Kubernetes' own."""
MAINTENANCE = {
    "backup": ["admin", "backup", "$(BACKUPS)"],
    "gc": ["admin", "gc"],
}
DOCKERFILE = KUBERNETES.parent / "docker" / "Dockerfile"
VERSIONS = ("1.29", kubernetes_validate.latest_version())
VERSION = __version__
OURS = ("api", "construct", "simulate-mujoco", "simulate-pybullet")
NO_MANIFESTS = {"kustomization.yaml", "models.yaml"}
FILES = sorted(path for path in KUBERNETES.rglob("*.yaml") if path.name not in NO_MANIFESTS)
BUCKET = {"AWS_ENDPOINT", "AWS_REGION"}

in_each_overlay = [needs_kubectl, pytest.mark.parametrize("overlay", OVERLAYS)]


def each_overlay(test):
    for mark in in_each_overlay:
        test = mark(test)
    return test


def check(document: dict) -> None:
    """Validates a document against Kubernetes' own schemas, or those of what extends it."""
    if document["kind"] in SCHEMAS:
        jsonschema.Draft202012Validator(SCHEMAS[document["kind"]]).validate(document)
        return
    for version in VERSIONS:
        kubernetes_validate.validate(document, version, strict=True)


def test_each_file_is_valid_by_itself(subtests) -> None:
    for path in FILES:
        with subtests.test(path=path):
            for document in read(path.read_text()):
                check(document)


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@each_overlay
def test_each_overlay_is_valid_as_a_whole(overlay) -> None:
    documents = rendered(overlay)
    names = [(each["kind"], each["metadata"]["name"]) for each in documents]
    assert len(set(names)) == len(names)
    for document in documents:
        check(document)
        if document["kind"] != "Namespace":
            assert document["metadata"]["namespace"] == "buildarena"


def test_a_wrong_document_is_found() -> None:
    (service,) = of_kind(read((KUBERNETES / "base" / "api.yaml").read_text()), "Service").values()
    service["spec"]["prots"] = []
    with pytest.raises(kubernetes_validate.ValidationError, match="prots"):
        check(service)


@each_overlay
def test_no_pod_has_more_rights_than_it_needs(overlay) -> None:
    for name, pod in pods(rendered(overlay)).items():
        spec = pod["spec"]
        assert spec["automountServiceAccountToken"] is False, name
        assert spec["securityContext"]["runAsNonRoot"] is True
        assert spec["securityContext"]["runAsUser"] > 0
        assert spec["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
        for forbidden in ("hostNetwork", "hostPID", "hostIPC", "hostAliases"):
            assert forbidden not in spec
        assert not [volume for volume in spec["volumes"] if "hostPath" in volume]
        for container in [*spec["containers"], *spec.get("initContainers", [])]:
            assert container["securityContext"] == {
                "allowPrivilegeEscalation": False,
                "readOnlyRootFilesystem": True,
                "capabilities": {"drop": ["ALL"]},
            }, name
            assert container["resources"]["requests"].keys() == {"cpu", "memory"}
            assert "memory" in container["resources"]["limits"]


@each_overlay
def test_pods_mount_what_they_name(overlay) -> None:
    documents = rendered(overlay)
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
        # Files of secrets lie where one is mounted, under a key that is there.
        for entry in container.get("env", []):
            if not entry["name"].endswith("_FILE"):
                continue
            folder, _, file = entry["value"].rpartition("/")
            (at,) = [volume for volume, path in mounted.items() if path == folder]
            items = volumes[at]["secret"].get("items")
            assert items is None or file in {item["path"] for item in items}, entry


@each_overlay
def test_no_environment_holds_a_secret(overlay) -> None:
    documents = rendered(overlay)
    secret = {*(f"BUILDARENA_{name.upper()}" for name in SECRETS), *ARTIFACT_CREDENTIALS}
    secret -= {"BUILDARENA_ARTIFACTS_URL"}
    assert not of_kind(documents, "Secret")
    names = set()
    for pod in pods(documents).values():
        for container in pod["spec"]["containers"]:
            assert not [entry for entry in container.get("env", []) if "valueFrom" in entry]
            names |= {entry["name"] for entry in container.get("env", [])}
    names |= {name for each in of_kind(documents, "ConfigMap").values() for name in each["data"]}
    assert not [
        name for name in names if name in secret or re.search("PASSWORD$|_KEY$|TOKEN$", name)
    ]


@each_overlay
def test_settings_are_ones_that_there_are(overlay) -> None:
    documents = rendered(overlay)
    fields = {f"BUILDARENA_{name.upper()}" for name in Settings.model_fields}
    config = config_of(documents)
    assert set(config["data"]) - fields - BUCKET <= {"HOME"}
    for name in config["data"].keys() & fields:
        field = name.removeprefix("BUILDARENA_").lower()
        Settings.model_validate({field: config["data"][name]})
    files = {f"{name}_FILE" for name in [*fields, *ARTIFACT_CREDENTIALS]}
    providers = {entry.key for entry in load_registry().providers.values() if entry.key}
    for name in OURS:
        (container,) = pods(documents)[name]["spec"]["containers"]
        given = {entry["name"] for entry in container["env"]}
        assert "BUILDARENA_DATABASE_URL_FILE" in given
        for key in ("ADMIN_KEY", "METRICS_KEY"):
            assert (f"BUILDARENA_{key}_FILE" in given) == (name == "api")
        keys = {f"{key}_FILE" for key in providers} if name == "construct" else set()
        assert keys <= given
        assert given <= files | keys


@each_overlay
def test_each_workload_has_its_image_and_program(overlay) -> None:
    found = pods(rendered(overlay))
    images = {name: found[name]["spec"]["containers"][0]["image"] for name in [*OURS, "migrate"]}
    assert images == {
        **{name: f"buildarena/{name}:{VERSION}" for name in OURS},
        "migrate": f"buildarena/tools:{VERSION}",
    }
    assert {f"simulate-{engine}" for engine in installed_engines()} <= set(OURS)
    targets = re.findall(r"^FROM \S+ AS (\S+)$", DOCKERFILE.read_text(), re.MULTILINE)
    assert {image.split("/")[1].split(":")[0] for image in images.values()} <= set(targets)
    assert not [name for name in OURS if "command" in found[name]["spec"]["containers"][0]]
    assert found["migrate"]["spec"]["containers"][0]["args"] == ["admin", "migrate"]


@each_overlay
def test_pods_are_stopped_and_moved_with_care(overlay) -> None:
    documents = rendered(overlay)
    budgets = of_kind(documents, "PodDisruptionBudget")
    for name in OURS:
        pod = pods(documents)[name]
        assert pod["spec"]["terminationGracePeriodSeconds"] >= 30
        selector = budgets[name]["spec"]["selector"]["matchLabels"]
        assert selector.items() <= pod["metadata"]["labels"].items()
        container = pod["spec"]["containers"][0]
        assert ("readinessProbe" in container) == (name == "api")
        assert "livenessProbe" in container
        # What starts has its own time; then a probe needs no delay.
        assert container["startupProbe"]["failureThreshold"] >= 60
        assert "initialDelaySeconds" not in container["livenessProbe"]
    api = pods(documents)["api"]["spec"]["containers"][0]
    alive = api["livenessProbe"]["httpGet"]["path"]
    assert alive == "/openapi.json", "a lost database must not have the API killed"
    assert api["readinessProbe"]["httpGet"]["path"] == "/v1/health"


@each_overlay
def test_nothing_goes_in_or_out_that_is_not_named(overlay) -> None:
    documents = rendered(overlay)
    policies = of_kind(documents, "NetworkPolicy")
    closed = policies["nothing"]["spec"]
    assert closed == {"podSelector": {}, "policyTypes": ["Ingress", "Egress"]}
    everywhere = [
        (name, block["ipBlock"]["cidr"])
        for name, policy in policies.items()
        for rule in policy["spec"].get("egress", [])
        for block in rule["to"]
        if "ipBlock" in block
    ]
    assert ("providers", "0.0.0.0/0") in everywhere
    assert [name for name, cidr in everywhere if cidr == "0.0.0.0/0"] == ["providers"]
    labels = {name: pod["metadata"]["labels"] for name, pod in pods(documents).items()}
    for policy in policies.values():
        wanted = policy["spec"]["podSelector"].get("matchLabels", {})
        assert any(wanted.items() <= given.items() for given in labels.values()), policy
        for rule in [*policy["spec"].get("egress", []), *policy["spec"].get("ingress", [])]:
            assert rule["ports"], policy
    stores = policies["stores-out"]["spec"]["podSelector"]["matchLabels"]
    reach = {name for name, given in labels.items() if stores.items() <= given.items()}
    assert reach == {*OURS, "migrate", *MAINTENANCE} | ({"roles"} & set(labels))


@each_overlay
def test_services_and_ingress_lead_to_pods(overlay) -> None:
    documents = rendered(overlay)
    services = of_kind(documents, "Service")
    for name, service in services.items():
        pod = pods(documents)[name]
        assert service["spec"]["selector"].items() <= pod["metadata"]["labels"].items()
    (ingress,) = of_kind(documents, "Ingress").values()
    (rule,) = ingress["spec"]["rules"]
    assert [rule["host"]] == ingress["spec"]["tls"][0]["hosts"]
    (path,) = rule["http"]["paths"]
    backend = path["backend"]["service"]
    ports = {port["name"] for port in services[backend["name"]]["spec"]["ports"]}
    assert backend["port"]["name"] in ports
    assert (
        ingress["metadata"]["annotations"]["nginx.ingress.kubernetes.io/proxy-buffering"] == "off"
    )


@needs_kubectl
def test_what_is_scaled_has_no_number_of_its_own() -> None:
    documents = rendered("external")
    deployments = of_kind(documents, "Deployment")
    scaled = of_kind(documents, "ScaledObject", "HorizontalPodAutoscaler")
    assert set(scaled) == set(deployments)
    for name, each in scaled.items():
        assert each["spec"]["scaleTargetRef"]["name"] == name
        assert "replicas" not in deployments[name]["spec"]


@needs_kubectl
@needs_promtool
def test_scaling_goes_by_figures_of_the_workers_own_queue(tmp_path) -> None:
    queues = {
        "construct": CONSTRUCT_QUEUE,
        **{f"simulate-{engine}": simulate_queue(engine) for engine in installed_engines()},
    }
    rules = []
    for name, each in of_kind(rendered("external"), "ScaledObject").items():
        (trigger,) = each["spec"]["triggers"]
        query = trigger["metadata"]["query"]
        assert re.findall(r'(\w+){queue="([^"]+)"}', query) == [
            ("buildarena_queue_jobs", queues[name]),
            ("buildarena_queue_running", queues[name]),
        ]
        rules.append({"record": f"x:{name.replace('-', '_')}", "expr": query})
    file = tmp_path / "queries.yml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "x", "rules": rules}]}))
    promtool("check", "rules", str(file))


@each_overlay
def test_pods_of_a_kind_are_spread_by_their_name(overlay) -> None:
    for name, pod in pods(rendered(overlay)).items():
        if name in OURS:
            (spread,) = pod["spec"]["topologySpreadConstraints"]
            assert spread["topologyKey"] == "kubernetes.io/hostname"
            assert spread["labelSelector"]["matchLabels"] == {"app.kubernetes.io/name": name}


@each_overlay
def test_a_change_of_settings_rolls_pods_out(overlay) -> None:
    documents = rendered(overlay)
    config, models = config_of(documents), config_of(documents, "models")
    assert {**load_models(models)} == {}, "as it comes it adds nothing"
    for name in OURS:
        spec = pods(documents)[name]["spec"]
        (container,) = spec["containers"]
        assert container["envFrom"] == [{"configMapRef": {"name": config["metadata"]["name"]}}]
        mounted = [v["configMap"]["name"] for v in spec["volumes"] if "configMap" in v]
        assert mounted == ([models["metadata"]["name"]] if name in {"api", "construct"} else [])


def load_models(config: dict) -> dict:
    return {k: v for k, v in yaml.safe_load(config["data"]["models.yaml"]).items() if v}


@each_overlay
def test_a_job_of_each_version_has_a_name_of_its_own_and_nothing_that_changes(overlay) -> None:
    for name, job in of_kind(rendered(overlay), "Job").items():
        label = job["metadata"]["labels"]["app.kubernetes.io/name"]
        assert name == f"{label}-{VERSION}"
        (container,) = job["spec"]["template"]["spec"]["containers"]
        assert "envFrom" not in container, "a ConfigMap's name changes with it, and a job can't"


@each_overlay
def test_what_must_be_done_again_and_again_has_its_times(overlay) -> None:
    documents = rendered(overlay)
    found = of_kind(documents, "CronJob")
    assert set(found) == set(MAINTENANCE)
    assert len({each["spec"]["schedule"] for each in found.values()}) == len(found)
    for name, each in found.items():
        assert each["spec"]["concurrencyPolicy"] == "Forbid"
        (container,) = pods(documents)[name]["spec"]["containers"]
        assert container["args"] == MAINTENANCE[name]
        assert container["args"][0] == "admin"
        assert container["args"][1] in ADMIN
        assert container["image"] == f"buildarena/tools:{VERSION}"
        given = {entry["name"]: entry["value"] for entry in container["env"]}
        mounts = {mount["mountPath"] for mount in container["volumeMounts"]}
        if overlay == "small":
            assert "/artifacts" in mounts
        else:
            assert "AWS_SECRET_ACCESS_KEY_FILE" in given
        if name == "backup":
            artifacts = config_of(documents)["data"].get("BUILDARENA_ARTIFACTS_URL", "/artifacts")
            bucket = artifacts.removesuffix("/artifacts") or "/artifacts"
            assert not given["BACKUPS"].startswith(f"{bucket}/"), "apart from what it saves"
            assert given["BACKUPS"].startswith("s3://") or given["BACKUPS"] in mounts


@needs_kubectl
def test_postgres_compiles_no_short_query() -> None:
    (container,) = pods(rendered("small"))["postgres"]["spec"]["containers"]
    assert "jit=off" in container["args"]
    assert container["startupProbe"]["failureThreshold"] >= 60


@pytest.fixture
def with_component(tmp_path):
    """What an overlay applies with one of the components."""

    def render(overlay: str, component: str) -> list[dict]:
        resource = os.path.relpath(KUBERNETES / "overlays" / overlay, tmp_path)
        added = os.path.relpath(KUBERNETES / "components" / component, tmp_path)
        text = yaml.safe_dump({"resources": [resource], "components": [added]})
        (tmp_path / "kustomization.yaml").write_text(text)
        documents = kustomized(tmp_path)
        for document in documents:
            check(document)
        return documents

    return render


@pytest.mark.ci
@each_overlay
def test_a_gateway_takes_the_place_of_the_ingress(overlay, with_component) -> None:
    documents = with_component(overlay, "gateway")
    assert not of_kind(documents, "Ingress")
    (route,) = of_kind(documents, "HTTPRoute").values()
    (rule,) = route["spec"]["rules"]
    (backend,) = rule["backendRefs"]
    (port,) = of_kind(documents, "Service")[backend["name"]]["spec"]["ports"]
    assert backend["port"] == port["port"]
    assert rule["timeouts"]["request"] == "0s", "streams stay open"
    callers = of_kind(documents, "NetworkPolicy")["callers"]["spec"]["ingress"][0]["from"]
    spaces = [each["namespaceSelector"]["matchLabels"] for each in callers]
    parent = route["spec"]["parentRefs"][0]["namespace"]
    assert {"kubernetes.io/metadata.name": parent} in spaces


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@each_overlay
def test_prometheus_operator_finds_each_pod_of_the_api(overlay, with_component) -> None:
    documents = with_component(overlay, "prometheus-operator")
    (monitor,) = of_kind(documents, "PodMonitor").values()
    pod = pods(documents)["api"]
    selector = monitor["spec"]["selector"]["matchLabels"]
    assert selector.items() <= pod["metadata"]["labels"].items()
    (endpoint,) = monitor["spec"]["podMetricsEndpoints"]
    assert endpoint["port"] in {port["name"] for port in pod["spec"]["containers"][0]["ports"]}
    scraped = yaml.safe_load(
        (KUBERNETES.parent / "monitoring/prometheus/prometheus.yml").read_text()
    )["scrape_configs"]
    assert endpoint["path"] in {each.get("metrics_path") for each in scraped}
    secret = next(v["secret"] for v in pod["spec"]["volumes"] if v["name"] == "secrets")
    credentials = endpoint["authorization"]["credentials"]
    assert credentials["name"] == secret["secretName"]
    assert credentials["key"] in {item["key"] for item in secret["items"]}


@pytest.mark.ci
@each_overlay
def test_models_in_the_cluster_can_be_named_and_reached(overlay, with_component, tmp_path) -> None:
    documents = with_component(overlay, "models-in-cluster")
    file = tmp_path / "models.yaml"
    file.write_text(config_of(documents, "models")["data"]["models.yaml"])
    registry = load_registry(file)
    (model,) = registry.models.keys() - load_registry().models.keys()
    url = urlsplit(registry.provider_of(registry.models[model]).base_url)
    _, namespace, kind = url.hostname.split(".")
    policy = of_kind(documents, "NetworkPolicy")["models-in-cluster"]["spec"]
    assert policy["podSelector"]["matchLabels"] == {"app.kubernetes.io/name": "construct"}
    (rule,) = policy["egress"]
    assert kind == "svc"
    assert rule["ports"] == [{"protocol": "TCP", "port": url.port}]
    (to,) = rule["to"]
    assert to["namespaceSelector"]["matchLabels"] == {"kubernetes.io/metadata.name": namespace}


def test_a_wrong_document_of_what_extends_kubernetes_is_found(subtests) -> None:
    for path, spoil in [
        ("components/gateway/route.yaml", lambda spec: spec["rules"][0].update(backend="api")),
        ("components/gateway/route.yaml", lambda spec: spec["rules"][0].update(timeouts=3)),
        ("components/prometheus-operator/pods.yaml", lambda spec: spec.pop("selector")),
        ("overlays/external/scaling.yaml", lambda spec: spec.update(minReplicas=1)),
    ]:
        with subtests.test(path=path):
            document = read((KUBERNETES / path).read_text())[0]
            check(document)
            spoil(document["spec"])
            with pytest.raises(jsonschema.ValidationError):
                check(document)
