"""A workflow that asks its model once and attaches one block: next to nothing but pipeline."""

from buildarena_geometry import Machine
from buildarena_worker.session.dialogue import Dialogue, Role
from buildarena_worker.session.session import Session


class OneBlock:
    """One request, one block attached."""

    def build(self, session: Session) -> Machine:
        """A starting block with one more on it."""
        dialogue = Dialogue(session, phase="build", opening=session.statement)
        dialogue.turn(Role(name="builder", system="Say something."))
        session.machine = Machine()
        session.machine.act("start", {})
        block = {"base_block": "1", "face": "C", "new_block": "Torch"}
        session.machine.act("attach_block_to", block)
        return session.machine
