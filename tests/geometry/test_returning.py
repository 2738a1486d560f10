"""Going back to an earlier value of a machine: equal to having gone there by copying."""

import pickle
from copy import deepcopy

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from buildarena_geometry import Machine

MODULES = ("Small Wooden Block", "Powered Wheel", "Torch", "Ballast")
attach = st.builds(
    lambda base, face, module: (
        "attach_block_to",
        {"base_block": str(base), "face": face, "new_block": module},
    ),
    st.integers(1, 9),
    st.sampled_from("ABCDEF"),
    st.sampled_from(MODULES),
)
remove = st.builds(lambda base: ("remove_block", {"block_id": str(base)}), st.integers(2, 9))
twist = st.builds(
    lambda base, angle: ("twist_block", {"block_id": str(base), "angle": angle}),
    st.integers(2, 9),
    st.sampled_from((90, 45, 180)),
)
reset = st.just(("reset", {}))
start = st.just(("start", {}))
actions = st.lists(st.one_of(attach, attach, attach, remove, twist, start, reset), max_size=12)


def done(machine: Machine, todo) -> list[str]:
    return [machine.act(name, arguments).text for name, arguments in todo]


@settings(max_examples=30, deadline=None)
@given(first=actions, then=actions)
@pytest.mark.parametrize("again", [deepcopy, lambda machine: pickle.loads(pickle.dumps(machine))])
def test_a_machine_is_pickled_and_goes_on(again, first, then) -> None:
    machine = Machine()
    done(machine, [("start", {}), *first])
    copy = again(machine)
    assert (copy, copy.logged) == (machine, machine.logged)
    assert done(copy, then) == done(machine, then)


@settings(max_examples=60, deadline=None)
@given(first=actions, astray=actions, then=actions)
def test_a_machine_that_went_back_goes_on_like_a_copy(first, astray, then) -> None:
    machine = Machine()
    done(machine, [("start", {}), *first])
    kept = machine.logged
    copy = machine.copy()
    done(machine, astray)
    machine.return_to(kept)
    assert machine.logged == copy.logged
    assert done(machine, then) == done(copy, then)
    assert machine.to_document() == copy.to_document()


def test_a_value_of_another_assembly_is_refused() -> None:
    part = Machine()
    part.act("start", {})
    one, other = Machine(available={"part": part}), Machine(available={"part": part})
    one.act("add_machine", {"machine_id": "part"})
    kept = one.logged
    one.act("add_machine", {"machine_id": "part", "init_shift": [9, 0, 0]})
    one.return_to(kept)
    assert list(one.blocks) == list(Machine.restored(kept).blocks)
    with pytest.raises(ValueError, match="other sub-structures"):
        other.return_to(kept)
