"""Keys in variables and files: the client reads them as the service reads its secrets."""

import pytest

from buildarena_client.config import stored_key
from buildarena_client.errors import BadArgumentError
from buildarena_pipeline.secret_files import MAX_BYTES, SecretFileError, read_secret


def by_client(environment: dict[str, str]) -> str | None:
    return stored_key(environment)


def by_service(environment: dict[str, str]) -> str | None:
    return read_secret("BUILDARENA_KEY", environment)


READERS = [by_client, by_service]


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    ("data", "key"),
    [(b"k\n", "k"), (b"k\r\n", "k"), (b"k\n\n", "k\n"), (b" k ", " k "), (b"a\nb\n", "a\nb")],
)
def test_one_line_end_is_cut(read, data, key, tmp_path) -> None:
    file = tmp_path / "key"
    file.write_bytes(data)
    assert read({"BUILDARENA_KEY_FILE": str(file)}) == key


@pytest.mark.parametrize("read", READERS)
def test_empty_variables_are_not_set(read) -> None:
    assert read({}) is read({"BUILDARENA_KEY": "", "BUILDARENA_KEY_FILE": ""}) is None
    assert read({"BUILDARENA_KEY": " k \n", "BUILDARENA_KEY_FILE": ""}) == " k \n"


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "is empty"),
        (b" \r\n", "is empty"),
        (b"\xff", "not UTF-8"),
        (b"secret" * MAX_BYTES, "more than"),
        (None, "No such file"),
    ],
)
def test_what_holds_no_key_is_refused_unseen(read, data, says, tmp_path) -> None:
    file = tmp_path / "key"
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(
        (BadArgumentError, SecretFileError), match=f"BUILDARENA_KEY_FILE.*{says}"
    ) as e:
        read({"BUILDARENA_KEY_FILE": str(file)})
    assert "secret" not in str(e.value)


@pytest.mark.parametrize("read", READERS)
def test_both_are_one_too_many(read) -> None:
    with pytest.raises((BadArgumentError, SecretFileError), match="are both set"):
        read({"BUILDARENA_KEY": "secret", "BUILDARENA_KEY_FILE": "x"})
