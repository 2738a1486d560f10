from __future__ import annotations

import os
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import ClassVar

import pytest

from buildarena_cli.client import Client
from buildarena_cli.errors import CommandError
from buildarena_pipeline.catalog.models import ModelEntry, ProviderEntry
from buildarena_pipeline.errors import PermanentError, StartupError
from buildarena_pipeline.runtime.context import open_context
from buildarena_pipeline.runtime.settings import ARTIFACT_CREDENTIALS, SECRETS, load_settings
from buildarena_pipeline.secret_files import MAX_BYTES, read_secret
from buildarena_worker.providers.provider import ProviderClient

SECRET = "a-secret-of-some-length"
URLS = {
    "database_url": "postgresql://u:p@h/d",
    "broker_url": "redis://:p@h/0",
    "artifacts_url": "s3://u/b",
}


@pytest.fixture(autouse=True)
def bare(monkeypatch):
    for name in list(os.environ):
        if name.startswith(("BUILDARENA_", "AWS_")):
            monkeypatch.delenv(name)


def kept(tmp_path, data: bytes) -> str:
    file = tmp_path / "secret"
    file.write_bytes(data)
    return str(file)


def plain(value: object) -> object:
    return getattr(value, "get_secret_value", lambda: value)()


def test_each_secret_setting_can_stand_in_a_file(tmp_path, monkeypatch, subtests) -> None:
    for field in SECRETS:
        for end in ["", "\n", "\r\n"]:
            with subtests.test(field=field, end=end):
                value = URLS.get(field, SECRET)
                monkeypatch.setenv(
                    f"BUILDARENA_{field.upper()}_FILE", kept(tmp_path, f"{value}{end}".encode())
                )
                assert plain(getattr(load_settings(), field)) == value


def test_a_setting_given_in_both_ways_is_refused_by_both_names(
    tmp_path, monkeypatch, subtests
) -> None:
    for field in SECRETS:
        with subtests.test(field=field), monkeypatch.context() as patch:
            name = f"BUILDARENA_{field.upper()}"
            patch.setenv(name, SECRET)
            patch.setenv(f"{name}_FILE", kept(tmp_path, SECRET.encode()))
            with pytest.raises(
                StartupError, match=f"{name} and {name}_FILE are both set"
            ) as refused:
                load_settings()
            assert SECRET not in str(refused.value)


def test_of_a_file_one_line_end_alone_is_cut() -> None:
    assert read_secret("A", {}) is None
    assert read_secret("A", {"A": "", "A_FILE": ""}) is None
    assert read_secret("A", {"A": " x \n"}) == " x \n"


def test_what_else_a_file_holds_is_part_of_the_secret(tmp_path, subtests) -> None:
    for data, read in [(b"x\n\n", "x\n"), (b" x ", " x "), (b"a\nb\n", "a\nb")]:
        with subtests.test(data=data):
            assert read_secret("A", {"A_FILE": kept(tmp_path, data)}) == read


def test_a_file_that_holds_no_secret_is_refused_by_name(tmp_path, subtests) -> None:
    for data, reason in [
        (b"", "is empty"),
        (b"\n", "is empty"),
        (b" \r\n", "is empty"),
        (b"\xff\xfe", "not UTF-8"),
        (b"x" * (MAX_BYTES + 1), "more than"),
    ]:
        with subtests.test(data=data):
            file = kept(tmp_path, data)
            with pytest.raises(ValueError, match=f"A_FILE names {file}.*{reason}"):
                read_secret("A", {"A_FILE": file})


def test_a_file_that_is_not_there_or_is_none_is_refused_by_name(tmp_path) -> None:
    for path in (tmp_path / "gone", tmp_path, tmp_path / "a\0b"):
        with pytest.raises(ValueError, match="A_FILE names"):
            read_secret("A", {"A_FILE": str(path)})


def test_an_empty_file_variable_leaves_the_other(monkeypatch) -> None:
    monkeypatch.setenv("BUILDARENA_ADMIN_KEY", SECRET)
    monkeypatch.setenv("BUILDARENA_ADMIN_KEY_FILE", "")
    monkeypatch.setenv("BUILDARENA_OTLP_ENDPOINT", "")
    monkeypatch.setenv("BUILDARENA_PORT", "")
    found = load_settings()
    assert found.admin_keys == (SECRET,)
    assert found.otlp_endpoint is None


def test_a_wrong_setting_is_named_and_a_secret_never_shown(tmp_path, monkeypatch) -> None:
    for name in ("ADMIN_KEY", "PREVIOUS_ADMIN_KEY"):
        with monkeypatch.context() as own:
            own.setenv(f"BUILDARENA_{name}_FILE", kept(tmp_path, b"too-short"))
            with pytest.raises(StartupError, match=f"BUILDARENA_{name}: .*16") as refused:
                load_settings()
            assert "too-short" not in str(refused.value)
    monkeypatch.setenv("BUILDARENA_PORT", "90000")
    with pytest.raises(StartupError, match=r"BUILDARENA_PORT: .*'90000'"):
        load_settings()


def test_credentials_of_the_artifact_store_can_stand_in_files(
    tmp_path, monkeypatch, subtests
) -> None:
    for name in ARTIFACT_CREDENTIALS:
        with subtests.test(name=name), monkeypatch.context() as patch:
            patch.setenv(f"{name}_FILE", kept(tmp_path, b"shh\n"))
            assert load_settings(artifacts_url="s3://bucket/x").artifact_options == {name: "shh"}
            assert load_settings().artifact_options == {}
            assert "shh" not in repr(load_settings(artifacts_url="s3://bucket/x"))
            patch.setenv(name, "other")
            with pytest.raises(StartupError, match=f"{name} and {name}_FILE are both set"):
                load_settings()


class _Bucket(BaseHTTPRequestHandler):
    """Takes whatever is put, and notes with whose signature."""

    signatures: ClassVar[list[str]] = []

    def do_PUT(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        self.signatures.append(self.headers["Authorization"])
        self.send_response(200)
        self.send_header("ETag", '"1"')
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


def test_an_artifact_store_signs_with_the_credentials_of_files(
    settings, tmp_path, monkeypatch
) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        file = tmp_path / name
        file.write_text(f"{name.lower()}-by-file\n")
        monkeypatch.setenv(f"{name}_FILE", str(file))
    with ThreadingHTTPServer(("127.0.0.1", 0), _Bucket) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        monkeypatch.setenv("AWS_ENDPOINT", f"http://127.0.0.1:{server.server_port}")
        monkeypatch.setenv("AWS_ALLOW_HTTP", "true")
        monkeypatch.setenv("AWS_REGION", "us-east-1")
        given = settings.model_dump() | {"artifacts_url": "s3://arena/artifacts"}
        context = open_context(load_settings(**given))
        context.artifacts.put(b"a bridge", "application/json")
        context.close()
        server.shutdown()
        thread.join()
    (signature,) = _Bucket.signatures
    assert "Credential=aws_access_key_id-by-file/" in signature


def test_a_providers_key_can_stand_in_a_file(tmp_path, monkeypatch) -> None:
    entry = ModelEntry(name="x/y", provider="x", model="y")
    provider = ProviderEntry(protocol="openai", base_url="http://127.0.0.1:9", key="X_API_KEY")
    with pytest.raises(PermanentError, match="X_API_KEY or X_API_KEY_FILE"):
        ProviderClient(entry, provider)
    monkeypatch.setenv("X_API_KEY_FILE", kept(tmp_path, b"shh\n"))
    client = ProviderClient(entry, provider)
    assert client._key == "shh"
    client.close()
    monkeypatch.setenv("X_API_KEY", "other")
    with pytest.raises(PermanentError, match="X_API_KEY and X_API_KEY_FILE are both set"):
        ProviderClient(entry, provider)


def test_the_command_line_reads_its_key_from_a_file(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("BUILDARENA_KEY_FILE", kept(tmp_path, b"ba_key\n"))
    client = Client("http://127.0.0.1:9")
    assert client._api._transport._headers == {"Authorization": "Bearer ba_key"}
    monkeypatch.setenv("BUILDARENA_KEY", "other")
    with pytest.raises(CommandError, match="BUILDARENA_KEY and BUILDARENA_KEY_FILE are both set"):
        Client("http://127.0.0.1:9")


@pytest.mark.ci
def test_a_process_says_in_one_line_which_file_it_misses(tmp_path, subtests) -> None:
    for words in [
        ["buildarena_api"],
        ["buildarena_worker"],
        ["buildarena_simworker", "--simulator"],
    ]:
        with subtests.test(words=words):
            engine = ["mujoco"] if "--simulator" in words else []
            done = subprocess.run(
                [sys.executable, "-m", *words, *engine],
                env={**os.environ, "BUILDARENA_DATABASE_URL_FILE": str(tmp_path / "gone")},
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
            assert done.returncode == 1
            (line,) = done.stderr.splitlines()
            assert f"BUILDARENA_DATABASE_URL_FILE names {tmp_path / 'gone'}: No such file" in line


def test_keys_of_a_stack_pass_to_its_processes_once(tmp_path, monkeypatch) -> None:
    from buildarena_cli.local.stack import Stack

    monkeypatch.setenv("BUILDARENA_ADMIN_KEY_FILE", kept(tmp_path, SECRET.encode()))
    for name, value in URLS.items():
        file = tmp_path / name
        file.write_text(value)
        monkeypatch.setenv(f"BUILDARENA_{name.upper()}_FILE", str(file))
    made = Stack(load_settings(data=tmp_path / "data", require_keys=True))._start_servers()
    assert not [name for name in made if name.startswith("BUILDARENA_") and name.endswith("_FILE")]
    assert made["BUILDARENA_ADMIN_KEY"] == SECRET
    assert made["BUILDARENA_DATABASE_URL"] == URLS["database_url"]
    for name, value in made.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("BUILDARENA_ADMIN_KEY_FILE")
    for name in URLS:
        monkeypatch.delenv(f"BUILDARENA_{name.upper()}_FILE")
    assert load_settings().broker_url == URLS["broker_url"]
