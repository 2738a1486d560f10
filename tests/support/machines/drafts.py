"""Drafting machines for trials: the expert's draft, with keys and presses."""

from buildarena_benchmark.experts.drafting import Direction, Draft


class KeyedDraft(Draft):
    """A machine under construction whose keys are bound while it is drafted."""

    def placed(self, base: str, face: Direction, module: str, y_axis: Direction) -> str:
        """A block on a face, twisted until its own y axis looks a way."""
        made = self.attach(base, face, module)
        self.turn_axis(made, 1, y_axis)
        return made

    def bind(self, block: str, action: str, key: str) -> None:
        self.do("add_control_key", block_id=block, action=action, new_key=key)

    def press(self, key: str, time: float, hold_for: float) -> None:
        self.do("add_control_sequence", time=time, key=key, hold_for=hold_for)
