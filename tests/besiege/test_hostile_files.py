"""Machine files that were damaged, or made to do harm, are refused or sound."""

import os
import re
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.machine_files import RICH, published_files
from tests.besiege.foreign_files import FOREIGN, block, foreign
from tests.besiege.hostile import TRICKS, mutated, rearranged
from tests.besiege.playing import press, vehicle
from tests.besiege.round_trips import round_trip

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import MachineFileError, plain_machine_file, prepare_run, read_machine_file

pytestmark = pytest.mark.ci


def test_tricks_are_refused_in_a_moment(subtests) -> None:
    for trick in TRICKS:
        with subtests.test(trick=trick):
            started = time.process_time()
            with pytest.raises(MachineFileError) as refused:
                read_machine_file(TRICKS[trick])
            assert time.process_time() - started < 5
            assert "root:" not in str(refused.value)
            assert len(str(refused.value)) < 300


def test_bad_values_are_named(subtests) -> None:
    for old, new, says in [
        (
            'x="0" y="0" z="0.5"',
            'x="nan" y="0" z="0.5"',
            "block 2: Position x: 'nan' is not a number",
        ),
        ('x="0" y="0" z="0.5"', 'x="1e9" y="0" z="0.5"', "'1e9' is not a number within"),
        ('x="0" y="0" z="0.5"', 'y="0" z="0.5"', "block 2: Position x: '' is not"),
        ('id="15"', 'id="-3"', "block 2: its id '-3' is not the number of a type"),
        ('id="0"', 'id="15"', "no starting block"),
        ('<Rotation x="0" y="0" z="0" w="1"/>', '<Rotation x="0" y="0" z="0" w="0"/>', "no length"),
        ("Transform", "Transmogrify", "no Transform"),
    ]:
        with subtests.test(old=old):
            text = FOREIGN.format(blocks="", data="", version="1.4").replace(old, new)
            with pytest.raises(MachineFileError, match=re.escape(says)):
                read_machine_file(text.encode())


def test_a_thousand_blocks_at_one_place_are_no_hang() -> None:
    many = "".join(block(15, place='x="0" y="0" z="0.5"') for _ in range(1200))
    started = time.process_time()
    imported = foreign(many)
    assert imported.machine.part_count == 1202
    assert time.process_time() - started < 20


def exported(task: str) -> bytes:
    scenario, presses = builtin_tasks()[task].scenario, [press(1.0, "UpArrow", 1.0)]
    machine = vehicle(cannon=True)
    return prepare_run(machine, scenario, name="m", run_id="r", controls=presses).machine_file


_OURS = plain_machine_file(vehicle(cannon=True), name="m", controls=[press(1.0, "UpArrow", 1.0)])
SAMPLES = [published_files()["single_5_transport_medium"], _OURS]
SAMPLES += [exported("transport-2"), exported("lift-2"), RICH, RICH]


@pytest.mark.timeout(3600)
@given(st.integers(0, 2**32), st.sampled_from(SAMPLES), st.sampled_from([mutated, rearranged]))
@settings(max_examples=int(os.environ.get("BESIEGE_FILES", "150")), deadline=None)
def test_damaged_files_are_refused_or_go_round_without_a_loss(seed, sample, damage) -> None:
    started = time.process_time()
    round_trip(damage(sample, seed))
    assert time.process_time() - started < 10
