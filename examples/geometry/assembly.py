"""Assembly of machines: a beam on two towers, tied with braces."""

from __future__ import annotations

from buildarena_geometry import Machine, Outcome

BLOCK = "Small Wooden Block"


def row(length: int, face: str) -> Machine:
    """Build a starting block with a row of blocks on one of its faces."""
    machine = Machine()
    do(machine, "start")
    base, label = "1", face
    for _ in range(length):
        arguments = {"base_block": base, "face": label, "new_block": BLOCK}
        base, label = do(machine, "attach_block_to", arguments).changed[0], "E"
    return machine


def do(machine: Machine, action: str, arguments: dict[str, object] | None = None) -> Outcome:
    """Carry an action out, and exit if it is refused."""
    outcome = machine.act(action, arguments)
    if not outcome.ok:
        raise SystemExit(f"{action}: {outcome.text}")
    return outcome


def build_gate() -> Machine:
    """Build two towers of three blocks with a beam of five across."""
    gate = Machine(available={"tower": row(2, "C"), "beam": row(4, "A")})
    do(gate, "add_machine", {"machine_id": "tower"})
    do(gate, "add_machine", {"machine_id": "tower", "init_shift": [4, 0, 0]})
    do(gate, "add_machine", {"machine_id": "beam", "init_shift": [0, 0, 3]})
    for start, end, beam in (("A_3", "C_2", "C"), ("B_3", "C_4", "C")):
        brace = {"block_a": start, "face_a": "E", "block_b": end, "face_b": beam}
        do(gate, "connect_blocks", {**brace, "connector": "Brace"})
    return gate


if __name__ == "__main__":
    machine = build_gate()
    print(machine.act("get_machine_summary").text)
    print("detached:", machine.detached or "none")
