"""The compose file and the images' recipe: valid, closed, and saying what the settings say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from support.documents.locks import image_lock_names

from buildarena_cli.command_table import ADMIN
from buildarena_geometry import kernels
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.runtime.settings import Settings
from buildarena_pipeline.runtime.simulators.installed import installed_engines

ROOT = Path(__file__).parents[2]
COMPOSE_TEXT = (ROOT / "docker-compose.yml").read_text()
COMPOSE = yaml.safe_load(COMPOSE_TEXT)
SERVICES = COMPOSE["services"]
DOCKERFILE = (ROOT / "deploy/docker/Dockerfile").read_text()
PROGRAMS = Path(sys.executable).parent
OURS = {
    name: service
    for name, service in SERVICES.items()
    if service["image"].startswith("buildarena/")
}


@pytest.fixture
def image_lock(tmp_path) -> set[str]:
    return image_lock_names(tmp_path / "image")


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)


def _target(service: dict) -> str:
    return str(service["image"]).removeprefix("buildarena/").split(":")[0]


def variables(service: dict) -> dict[str, str]:
    found: dict[str, str] = service.get("environment", {})
    return found


def test_the_compose_file_follows_the_specification() -> None:
    words = ("--builtin-schema", "vendor.compose-spec", "docker-compose.yml")
    done = run(str(PROGRAMS / "check-jsonschema"), *words)
    assert done.returncode == 0, done.stdout


def test_recipes_are_clean(subtests) -> None:
    for path in ["deploy/docker/Dockerfile", "scenarios/containers/bases/Dockerfile"]:
        with subtests.test(path=path):
            done = run(str(PROGRAMS / "hadolint"), "--config", "deploy/docker/hadolint.yaml", path)
            assert (done.returncode, done.stdout) == (0, "")


def test_each_container_is_confined(subtests) -> None:
    for name in SERVICES:
        with subtests.test(name=name):
            service = SERVICES[name]
            assert service["read_only"] is True
            assert service["cap_drop"] == ["ALL"]
            assert "cap_add" not in service
            assert "privileged" not in service
            assert service["security_opt"] == ["no-new-privileges:true"]
            assert service.get("network_mode") is None
            if name not in OURS:
                user = str(service["user"]).split(":")[0]
                assert user not in {"0", "root"}
            assert not [volume for volume in service.get("volumes", []) if "docker.sock" in volume]


def test_images_of_ours_run_as_an_ordinary_user() -> None:
    stages = dict(
        re.findall(r"^FROM \S+ AS (\S+)\n(.*?)(?=^FROM |\Z)", DOCKERFILE, re.MULTILINE | re.DOTALL)
    )
    bases = dict(re.findall(r"^FROM (\S+) AS (\S+)$", DOCKERFILE, re.MULTILINE))
    parents = {stage: base for base, stage in bases.items()} | {
        stage: base
        for base, stage in re.findall(r"^FROM (\S+) AS (\S+)$", DOCKERFILE, re.MULTILINE)
    }
    for service in OURS.values():
        stage = _target(service)
        users: list[str] = []
        while stage in stages:
            users = re.findall(r"^USER (\S+)$", stages[stage], re.MULTILINE)
            if users:
                break
            stage = parents[stage]
        assert users[-1:] == ["10001:10001"], _target(service)


def test_images_of_services_are_one_environment() -> None:
    parents = {
        stage: base
        for base, stage in re.findall(r"^FROM (\S+) AS (\S+)$", DOCKERFILE, re.MULTILINE)
    }
    for target in {_target(service) for service in OURS.values()} - {"proxy"}:
        line = [target]
        while line[-1] in parents:
            line.append(parents[line[-1]])
        assert line[-4:] == ["service", "libraries", "runtime", "${PYTHON_IMAGE}"], line


def test_images_have_what_services_need_and_no_tools_of_ours(image_lock) -> None:
    assert {"mujoco", "pybullet", "psycopg", "celery"} <= image_lock
    assert not image_lock & {"pytest", "ribs", "mkdocs", "cython", "hatchling"}


def test_every_queue_has_a_service_and_every_target_a_recipe() -> None:
    targets = set(re.findall(r"^FROM \S+ AS (\S+)$", DOCKERFILE, re.MULTILINE))
    assert {_target(service) for service in OURS.values()} <= targets
    engines = {f"simulate-{name}" for name in installed_engines()}
    assert {"api", "construct", "migrate", "proxy", *engines} <= set(SERVICES)
    assert {SERVICES[name]["command"][1] for name in ("migrate", "roles")} <= set(ADMIN)


def test_only_settings_that_exist_are_set() -> None:
    known = {f"BUILDARENA_{name.upper()}" for name in Settings.model_fields} | {kernels.CHOICE}
    client = {"BUILDARENA_URL", "BUILDARENA_KEY"}
    proxy = {"BUILDARENA_SITE", "BUILDARENA_HTTPS_PORT", "BUILDARENA_TLS", "BUILDARENA_BASE_PATH"}
    for name, service in OURS.items():
        allowed = {"proxy": proxy, "tools": known | client}.get(name, known)
        for variable in variables(service):
            if variable.startswith("BUILDARENA_"):
                assert {variable, variable.removesuffix("_FILE")} & allowed, (name, variable)


def test_no_secret_stands_in_a_variable() -> None:
    for name, service in SERVICES.items():
        for variable, value in variables(service).items():
            secret = re.search(r"PASSWORD|SECRET|KEY|TOKEN|DATABASE_URL|BROKER_URL", variable)
            if secret:
                assert str(value).startswith("/run/secrets/"), (name, variable)
                mounted = [
                    each if isinstance(each, str) else each["target"] for each in service["secrets"]
                ]
                assert str(value).removeprefix("/run/secrets/") in mounted


def test_whoever_knows_the_models_mounts_the_operators_file(tmp_path) -> None:
    mounted = {
        name
        for name, service in SERVICES.items()
        if any("/etc/buildarena/models.yaml:ro" in each for each in service.get("volumes", []))
    }
    named = {name for name in SERVICES if "BUILDARENA_MODELS_FILE" in variables(SERVICES[name])}
    assert mounted == named == {"api", "construct"}
    example = ROOT / "deploy/docker/models.yaml"
    assert load_registry(example) == load_registry(), "as it comes it adds nothing"
    shown = [line.removeprefix("# ") for line in example.read_text().splitlines()[2:]]
    (tmp_path / "models.yaml").write_text("\n".join(shown))
    added = load_registry(tmp_path / "models.yaml")
    assert added.provider_of(added.models["own/big"]).key == "OWN_API_KEY"


def test_backups_are_of_no_project() -> None:
    volume = COMPOSE["volumes"]["backups"]
    assert volume["external"] is True
    name = volume["name"].partition(":-")[2].removesuffix("}")
    documented = (ROOT / "docs/deploying.md").read_text()
    assert f"docker volume create {name}" in documented
    assert "backups:/backups" in SERVICES["tools"]["volumes"]


def test_redirects_lead_to_the_port_that_people_reach() -> None:
    caddyfile = (ROOT / "deploy/caddy/Caddyfile").read_text()
    assert "auto_https disable_redirects" in caddyfile
    assert "redir https://{host}:{$BUILDARENA_HTTPS_PORT:443}{uri} 308" in caddyfile
    assert SERVICES["proxy"]["ports"][1] == "${BUILDARENA_HTTPS_PORT:-443}:8443"


def test_each_secret_is_made_and_each_variable_is_explained() -> None:
    script = (ROOT / "deploy/docker/make-secrets.sh").read_text()
    made = set(re.findall(r"\| keep (\w+)$", script, re.MULTILINE))
    assert made == set(COMPOSE["secrets"])
    example = (ROOT / ".env.example").read_text()
    used = dict(re.findall(r"\$\{(\w+):-([^}]*)\}", COMPOSE_TEXT))
    explained = dict(re.findall(r"^# ([A-Z][A-Z0-9_]+)=(\S*)", example, re.MULTILINE))
    assert set(used) == set(explained)
    for name, default in used.items():
        if default:
            assert explained[name] == default or name == "BUILDARENA_ARTIFACTS_URL", name


def test_secrets_once_made_stay_and_open_for_their_owner_alone(tmp_path) -> None:
    folder = tmp_path / "secrets"
    first = run("bash", "deploy/docker/make-secrets.sh", str(folder))
    assert first.returncode == 0, first.stderr
    before = {file.name: file.read_text() for file in folder.iterdir()}
    assert folder.stat().st_mode & 0o777 == 0o700
    assert before["postgres_password"] in before["database_url"]
    assert len(before["admin_key"]) == 64
    (folder / "admin_key").unlink()
    assert run("bash", "deploy/docker/make-secrets.sh", str(folder)).returncode == 0
    after = {file.name: file.read_text() for file in folder.iterdir()}
    assert after.pop("admin_key") != before.pop("admin_key")
    assert after == before


def test_what_git_must_not_take_is_ignored() -> None:
    ignored = run("git", "check-ignore", "secrets/admin_key", ".env")
    assert ignored.stdout.split() == ["secrets/admin_key", ".env"]
