"""Names belong to a key with all that look like them."""

import pytest
from sqlalchemy import text

from buildarena_store import NameTakenError
from buildarena_store.accounts.names import claim_name


@pytest.fixture
def claim(context):
    def take(name: str, owner: str | None = "key_1", kind: str = "agent", **more) -> None:
        with context.store.database.transaction() as connection:
            claim_name(kind, name, owner=owner, connection=connection, **more)

    return take


ALIKE = ["Ada-1", "ada1", "a.d.a.1", "ADA_1", "adal", "AdaI", "ada-l"]


@pytest.mark.parametrize("like", ALIKE)
@pytest.mark.parametrize("kind", ["agent", "task"])
def test_what_looks_like_anothers_name_is_not_to_be_had(claim, like, kind) -> None:
    claim("ada-1", kind=kind)
    with pytest.raises(NameTakenError, match=f"{like}.*looks like 'ada-1'"):
        claim(like, "key_2", kind)
    with pytest.raises(NameTakenError):
        claim(like, None, kind)
    claim(like, kind=kind)
    claim("ada-1", kind=kind)


@pytest.mark.parametrize(
    ("first", "second"),
    [("modern", "modem"), ("wave", "vvave"), ("O-neil", "0neil"), ("b5", "bs")],
)
def test_letters_of_one_shape_look_alike(claim, first, second) -> None:
    claim(first)
    with pytest.raises(NameTakenError, match="looks like"):
        claim(second, "key_2")


def test_other_names_are_free(claim) -> None:
    for number, name in enumerate(["ada", "adam", "ada-2", "ada-3", "bda"]):
        claim(name, f"key_{number}")


def test_kinds_of_players_share_what_looks_alike_and_tasks_do_not(claim) -> None:
    claim("ada")
    with pytest.raises(NameTakenError, match="'Ada' looks like 'ada', which is the name of an"):
        claim("Ada", kind="human")
    claim("ada", "key_2", "task")


def test_nothing_looks_like_a_reserved_name(claim) -> None:
    claim("support-11", kind="task", reserved=["support-1"])
    with pytest.raises(NameTakenError, match="looks like 'support-1'"):
        claim("supp0rt-1", kind="task", reserved=["support-1"])


def test_an_admin_may_and_the_name_stays_the_others(claim) -> None:
    claim("ada")
    claim("ada", None, force=True)
    with pytest.raises(NameTakenError):
        claim("ada", None)


def test_who_had_a_name_before_it_looked_like_anothers_keeps_it(claim, context) -> None:
    with context.store.database.transaction() as connection:
        connection.execute(
            text(
                "INSERT INTO names (kind, name, owner) VALUES ('agent', 'ada', 'a'), "
                "('agent', 'Ada', 'b')"
            )
        )
    claim("ada", "a")
    claim("Ada", "b")
    with pytest.raises(NameTakenError):
        claim("Ada", "a")
