"""Secrets may stand in files, of every process and every kind, and are never shown."""

import os

import pytest

from buildarena_backend.errors import StartupError
from buildarena_backend.secret_files import MAX_BYTES, read_secret
from buildarena_backend.settings import ARTIFACT_CREDENTIALS, SECRETS, load_settings
from buildarena_cli.local.stack import Stack

SECRET = "a-secret-of-some-length"
URLS = {"database_url": "postgresql://u:p@h/d", "broker_url": "redis://:p@h/0"}
URLS["artifacts_url"] = "s3://u/b"


@pytest.fixture(autouse=True)
def bare(monkeypatch):
    for name in list(os.environ):
        if name.startswith(("BUILDARENA_", "AWS_")):
            monkeypatch.delenv(name)


@pytest.fixture
def kept(tmp_path):
    def keep(data: bytes | str, name: str = "secret") -> str:
        file = tmp_path / name
        file.write_bytes(data if isinstance(data, bytes) else data.encode())
        return str(file)

    return keep


def test_each_secret_setting_can_stand_in_a_file_and_not_in_both(kept, monkeypatch) -> None:
    for field in SECRETS:
        name, value = f"BUILDARENA_{field.upper()}", URLS.get(field, SECRET)
        with monkeypatch.context() as patch:
            patch.setenv(f"{name}_FILE", kept(f"{value}\r\n"))
            found = getattr(load_settings(), field)
            assert getattr(found, "get_secret_value", lambda found=found: found)() == value
            patch.setenv(name, SECRET)
            both = f"{name} and {name}_FILE are both set"
            with pytest.raises(StartupError, match=both) as refused:
                load_settings()
            assert SECRET not in str(refused.value)
    for name in ARTIFACT_CREDENTIALS:
        with monkeypatch.context() as patch:
            patch.setenv(f"{name}_FILE", kept("shh\n"))
            found = load_settings(artifacts_url="s3://bucket/x")
            assert (found.artifact_options, "shh" in repr(found)) == ({name: "shh"}, False)
            assert load_settings().artifact_options == {}
            patch.setenv(name, "other")
            with pytest.raises(StartupError, match=f"{name} and {name}_FILE are both set"):
                load_settings(artifacts_url="s3://bucket/x")


def test_of_a_file_one_line_end_alone_is_cut(kept) -> None:
    assert read_secret("A", {}) is None
    assert read_secret("A", {"A": "", "A_FILE": ""}) is None
    assert read_secret("A", {"A": " x \n"}) == " x \n"
    ends = {b"x\n": "x", b"x\r\n": "x", b"x\n\n": "x\n", b" x ": " x ", b"a\nb\n": "a\nb"}
    assert {data: read_secret("A", {"A_FILE": kept(data)}) for data in ends} == ends


def test_a_file_that_holds_no_secret_or_is_none_is_refused_by_name(kept, tmp_path) -> None:
    for data, reason in [
        *((empty, "is empty") for empty in (b"", b"\n", b" \r\n")),
        *((b"\xff\xfe", "not UTF-8"), (b"x" * (MAX_BYTES + 1), "more than")),
    ]:
        file = kept(data)
        with pytest.raises(ValueError, match=f"A_FILE names {file}.*{reason}"):
            read_secret("A", {"A_FILE": file})
    for path in (tmp_path / "gone", tmp_path, tmp_path / "a\0b"):
        with pytest.raises(ValueError, match="A_FILE names"):
            read_secret("A", {"A_FILE": str(path)})


def test_a_wrong_setting_is_named_a_secret_not_shown_and_an_empty_one_none(
    kept, monkeypatch
) -> None:
    for name in ("ADMIN_KEY", "PREVIOUS_ADMIN_KEY"):
        with monkeypatch.context() as own:
            own.setenv(f"BUILDARENA_{name}_FILE", kept("too-short"))
            with pytest.raises(StartupError, match=f"BUILDARENA_{name}: .*16") as refused:
                load_settings()
            assert "too-short" not in str(refused.value)
    monkeypatch.setenv("BUILDARENA_PORT", "90000")
    with pytest.raises(StartupError, match=r"BUILDARENA_PORT: .*'90000'"):
        load_settings()
    monkeypatch.setenv("BUILDARENA_ADMIN_KEY", SECRET)
    for name in ("ADMIN_KEY_FILE", "OTLP_ENDPOINT", "PORT"):
        monkeypatch.setenv(f"BUILDARENA_{name}", "")
    found = load_settings()
    assert (found.admin_keys, found.otlp_endpoint) == ((SECRET,), None)


def test_keys_of_a_stack_pass_to_its_processes_once(kept, tmp_path, monkeypatch) -> None:
    for name, value in {"admin_key": SECRET, **URLS}.items():
        monkeypatch.setenv(f"BUILDARENA_{name.upper()}_FILE", kept(value, name))
    made = Stack(load_settings(data=tmp_path / "data", require_keys=True))._start_servers()
    assert not [name for name in made if name.startswith("BUILDARENA_") and name.endswith("_FILE")]
    assert made["BUILDARENA_ADMIN_KEY"] == SECRET
    assert made["BUILDARENA_DATABASE_URL"] == URLS["database_url"]
    for name in ("admin_key", *URLS):
        monkeypatch.delenv(f"BUILDARENA_{name.upper()}_FILE")
    for name, value in made.items():
        monkeypatch.setenv(name, value)
    assert load_settings().broker_url == URLS["broker_url"]
