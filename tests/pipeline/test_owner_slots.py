from __future__ import annotations

from buildarena_pipeline.runtime.owner_slots import OwnerSlots


def greedy(slots: OwnerSlots, owner: str) -> int:
    """How many further slots an owner gets that takes all it can."""
    taken = 0
    while slots.free and owner not in slots.full():
        slots.take(owner)
        taken += 1
    return taken


def test_one_owner_alone_gets_what_is_configured_and_another_finds_room(subtests) -> None:
    for configured in [1, 2, 3, 5, 8, 32, 40, 200]:
        with subtests.test(configured=configured):
            slots = OwnerSlots(configured)
            assert greedy(slots, "a") == configured
            assert greedy(slots, "b") >= 1


def test_each_of_several_owners_finds_less_room_but_some() -> None:
    slots = OwnerSlots(40)
    assert [greedy(slots, owner) for owner in "abcd"] == [40, 8, 1, 1]
    assert slots.free == 0
    for _ in range(20):
        slots.give_back("a")
    assert greedy(slots, "d") > 10
    assert "a" not in slots.full() or slots.free <= 5


def test_the_last_slot_is_for_an_owner_that_has_none() -> None:
    slots = OwnerSlots(1)
    slots.take("a")
    assert slots.full() == ["a"]
    slots.give_back("a")
    assert slots.full() == []
    assert slots.free == slots.total
