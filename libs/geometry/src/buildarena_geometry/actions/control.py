"""Actions on key bindings and on the control sequence."""

from dataclasses import replace

from buildarena_geometry.actions.lookups import part, powered, require_started
from buildarena_geometry.actions.parameters import (
    BlockId,
    Index,
    Key,
    Name,
    Number,
    Presses,
    RefusalError,
    quote,
)
from buildarena_geometry.blocks import Connector, KeyPress
from buildarena_geometry.feedback import state as words
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.keys import KEYS, KEYS_IN_WORDS
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.state import Change, MachineState


def change_control_key(
    state: MachineState, block_id: BlockId, action: Name, new_key: Key
) -> Change:
    """Bind a key to an action of a block, replacing its keys.

    Keys: UpArrow, DownArrow, LeftArrow, RightArrow, Alpha0 to Alpha9, Keypad0 to Keypad9.

    Args:
        block_id: Id of the block.
        action: The block's action, such as "spinning_forward".
        new_key: The key.
    """
    return _bind(state, block_id, action, new_key, keep=False)


def add_control_key(state: MachineState, block_id: BlockId, action: Name, new_key: Key) -> Change:
    """Bind a further key to an action of a block.

    Args:
        block_id: Id of the block.
        action: The block's action, such as "spinning_forward".
        new_key: The key.
    """
    return _bind(state, block_id, action, new_key, keep=True)


def add_control_sequence(
    state: MachineState, *, time: Number, key: Key, hold_for: Number, more: Presses = ()
) -> Change:
    """Add key presses (times in seconds); presses may overlap.

    Args:
        time: When the key goes down, in seconds from the start, at least 0.
        key: A key that some block is bound to.
        hold_for: How long it stays down, in seconds, more than 0.
        more: Further presses; all are added or none.
    """
    require_started(state)
    bound = state.keys_in_use()
    presses = tuple(_press(bound, *press) for press in ((time, key, hold_for), *more))
    after = replace(state, control_sequence=(*state.control_sequence, *presses))
    return Change(after=after, render=lambda: words.added_presses(after, len(presses)))


def _press(bound: tuple[str, ...], time: float, key: str, hold_for: float) -> KeyPress:
    """Return a key press that can be played, by one of the keys that some action has."""
    if key not in bound:
        problem = "no action has this key" if key in KEYS else "there is no such key"
        text = f"{quote(key)}: {problem}. Keys in use: {listing(bound)}."
        raise RefusalError(Cause.BAD_KEY, text)
    if time < 0 or hold_for <= 0:
        needed = "time must be at least 0 and hold_for more than 0"
        text = f"{needed}, not {quote(time)} and {quote(hold_for)}."
        raise RefusalError(Cause.OUT_OF_RANGE, text)
    return KeyPress(time_s=time, key=key, hold_for_s=hold_for)


def remove_control_sequence(state: MachineState, index: Index) -> Change:
    """Remove a key press.

    Args:
        index: Its number in review_control_sequence, from 0.
    """
    presses = state.control_sequence
    if not 0 <= index < len(presses):
        choices = f"0 to {len(presses) - 1}" if presses else "none"
        text = f"There is no entry {quote(index)}. Entries: {choices}."
        raise RefusalError(Cause.BAD_INDEX, text)
    after = replace(state, control_sequence=(*presses[:index], *presses[index + 1 :]))
    return Change(after=after, render=lambda: f"Removed.\n{words.control_sequence(after)}")


def reset_control_sequence(state: MachineState) -> Change:
    """Remove all key presses; key bindings stay."""
    after = replace(state, control_sequence=())
    return Change(after=after, render=lambda: words.control_sequence(after))


def _bind(state: MachineState, block_id: str, written: str, key: str, *, keep: bool) -> Change:
    part(state, block_id)
    if key not in KEYS:
        raise RefusalError(Cause.BAD_KEY, f"There is no key {quote(key)}. Keys: {KEYS_IN_WORDS}.")
    target, action = powered(state, block_id, written)
    had = target.bindings.get(action, ()) if keep else ()
    keys = had if key in had else (*had, key)
    bound = replace(target, bindings={**target.bindings, action: keys})
    if isinstance(bound, Connector):
        after = state.with_connector(bound)
    else:
        after = replace(state, blocks={**state.blocks, bound.id: bound})
    return Change(
        after=after,
        touched=(target.id,),
        render=lambda: f"Bound: {words.title(target)}, {action}: {listing(keys)}.",
    )
