"""A key goes to the host that it was given for, and nowhere else."""

import contextlib
import json
import socket
import ssl
import threading
import traceback
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from support.servers.wrong_server import answer, wrong_server

from buildarena_client import (
    BadArgumentError,
    ClientError,
    RefusedError,
    UnreachableError,
)

SECRET = "ba_secret-that-nobody-sees"
SPEC = {"tasks": ["lift-1"], "models": ["builtin/idle"]}


def test_a_key_goes_to_one_host_alone(make, monkeypatch) -> None:
    with wrong_server(answer(200, b"[]")) as other:
        for name in ("http_proxy", "HTTP_PROXY", "https_proxy", "ALL_PROXY", "all_proxy"):
            monkeypatch.setenv(name, other.url)
        for status in (301, 302, 303, 307, 308):
            moved = answer(status, Location=f"{other.url}/v1/tasks")
            with wrong_server(moved) as server:
                client = make(server.url, SECRET)
                for send in (client.tasks, lambda: client.submit_job("a", "b")):  # noqa: B023
                    with pytest.raises(RefusedError, match=f"HTTP {status}"):
                        send()
                assert server.headers("Authorization") == [f"Bearer {SECRET}"] * 2
        assert other.received == []


@pytest.mark.parametrize("status", [400, 401, 403, 404, 409, 413, 422, 429, 500, 503])
def test_a_key_is_in_no_error(make, status) -> None:
    problem = {
        "detail": f"Bearer {SECRET} is bad",
        "errors": [{"field": SECRET, "message": f"not {SECRET}", "choices": [SECRET]}],
    }
    with wrong_server(answer(status, json.dumps(problem).encode())) as server:
        client = make(server.url, SECRET)
        with pytest.raises(ClientError) as raised:
            client.tasks()
    error = raised.value
    told = [str(error), repr(error), str(vars(error)), *traceback.format_exception(error)]
    assert SECRET not in "".join(told)
    assert SECRET not in repr(client.made)
    assert server.url in repr(client.made)


@pytest.mark.parametrize("key", ["a\r\nHost: x", "é", "a\0b"])
def test_what_is_no_key_is_refused_unseen(make, key) -> None:
    with pytest.raises(BadArgumentError, match="is not a key") as refused:
        make("http://127.0.0.1:1", key)
    assert key not in str(refused.value)


@pytest.mark.parametrize(
    "url",
    [
        *("ftp://x", "nonsense", "http://", "http://x:99999", "http://x:0", "http://["),
        *("http://x/?a=b", "http://x/#y", "http://x/\r\n", "file:///etc/passwd", ""),
    ],
)
def test_what_is_no_url_is_refused(make, url) -> None:
    with pytest.raises(BadArgumentError, match="is not the URL of an API"):
        make(url)


def test_a_password_in_a_url_is_refused_unseen(make) -> None:
    with pytest.raises(BadArgumentError, match="no user or password") as refused:
        make("http://me:hush@127.0.0.1:1")
    assert "hush" not in str(refused.value)


def test_no_header_and_no_document_is_made_of_nonsense(make) -> None:
    with wrong_server(answer(200)) as server:
        client = make(server.url)
        with pytest.raises(BadArgumentError, match="can't be sent as Idempotency-Key"):
            client.submit_sweep(SPEC, request_key="a\r\nX: y")
        for nonsense in (float("nan"), {1, 2}, object()):
            with pytest.raises(BadArgumentError, match="can't be sent as JSON"):
                client.submit_sweep({**SPEC, "seeds": nonsense})
    assert server.received == []


def test_a_server_that_nobody_vouches_for_gets_no_key(make, tmp_path) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(self_signed(tmp_path))
    received = []

    def serve() -> None:
        connection, _ = listening.accept()
        with (
            contextlib.suppress(OSError),
            connection,
            context.wrap_socket(connection, server_side=True) as secured,
        ):
            received.append(secured.recv(65536))

    with socket.create_server(("127.0.0.1", 0)) as listening:
        thread = threading.Thread(target=serve)
        thread.start()
        url = f"https://127.0.0.1:{listening.getsockname()[1]}"
        with pytest.raises(UnreachableError, match=r"(?i)certificate.verify"):
            make(url, SECRET).tasks()
        thread.join()
    assert received in ([], [b""])


def self_signed(folder) -> Path:
    """A certificate with its key, which says of itself that it is good."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "127.0.0.1")])
    start = datetime.now(UTC) - timedelta(days=1)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(start)
        .not_valid_after(start + timedelta(days=2))
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), critical=False
        )
        .sign(key, hashes.SHA256())
    )
    file = folder / "server.pem"
    pem = serialization.Encoding.PEM
    form, secret = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    file.write_bytes(key.private_bytes(pem, form, secret) + made.public_bytes(pem))
    return file
