"""The game's window on X11, by Xlib, which PyAutoGUI brings along."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from typing import Any

from buildarena_simworker.besiege.errors import NotSetUpError, ScreenError
from buildarena_simworker.besiege.screen.windows import Area, WindowIdentity


@contextlib.contextmanager
def _answered() -> Iterator[None]:
    """Report a screen that is gone, or a window that closed meanwhile, as a fault."""
    from Xlib import error

    try:
        yield
    except (error.ConnectionClosedError, error.XError, OSError) as fault:
        raise ScreenError(f"the screen does not answer: {fault}") from fault


class X11Windows:
    """X11 windows, with or without a window manager.

    Args:
        identity: Identification of the window.

    Raises:
        NotSetUpError: The screen is missing.
    """

    def __init__(self, identity: WindowIdentity) -> None:
        from Xlib import display, error

        self.identity = identity
        # Xlib prints what it misses to standard output, which is for results.
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                self._display = display.Display()
        except (error.DisplayError, OSError) as fault:
            raise NotSetUpError(f"there is no screen to play on: {fault}") from fault
        self._root = self._display.screen().root

    @_answered()
    def find(self) -> Area | None:
        """Return the game's drawing area."""
        window = self._window()
        return None if window is None else self._area(window)

    @_answered()
    def process(self) -> int | None:
        """Return the id of its process, if its program reports it."""
        window = self._window()
        return None if window is None else self._process_of(window)

    @_answered()
    def raise_(self) -> None:
        """Bring it to the front and give it the keyboard."""
        from Xlib import X
        from Xlib.protocol import event

        window = self._window()
        if window is None:
            return
        active = self._display.intern_atom("_NET_ACTIVE_WINDOW")
        window.configure(stack_mode=X.Above)
        # A window manager that knows the message does the rest; without one this does it.
        message = event.ClientMessage(
            window=window, client_type=active, data=(32, [2, X.CurrentTime, 0, 0, 0])
        )
        mask = X.SubstructureRedirectMask | X.SubstructureNotifyMask
        self._root.send_event(message, event_mask=mask)
        window.set_input_focus(X.RevertToParent, X.CurrentTime)
        self._display.sync()

    @_answered()
    def is_active(self) -> bool:
        """Check if it has the keyboard."""
        window = self._window()
        focus = self._display.get_input_focus().focus
        while window is not None and not isinstance(focus, int):
            if focus.id == window.id:
                return True
            parent = focus.query_tree().parent
            if isinstance(parent, int) or parent is None:
                return False
            focus = parent
        return False

    def _window(self) -> Any:
        """Return the topmost shown window of the game."""
        waiting = [self._root]
        match = None
        while waiting:
            window = waiting.pop(0)
            try:
                children = window.query_tree().children
                if (
                    self.identity.has_title(self._name(window))
                    and self._is_shown(window)
                    and self.identity.has_program(self._process_of(window))
                ):
                    match = window
            except self._gone():
                continue
            waiting += children
        return match

    def _name(self, window: Any) -> str:
        for atom in ("_NET_WM_NAME", "WM_NAME"):
            name_property = window.get_full_property(self._display.intern_atom(atom), 0)
            if name_property is not None and name_property.value:
                value = name_property.value
                return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
        return ""

    def _process_of(self, window: Any) -> int | None:
        number = window.get_full_property(self._display.intern_atom("_NET_WM_PID"), 0)
        return int(number.value[0]) if number is not None and len(number.value) else None

    def _is_shown(self, window: Any) -> bool:
        from Xlib import X

        return bool(window.get_attributes().map_state == X.IsViewable)

    def _area(self, window: Any) -> Area | None:
        try:
            size = window.get_geometry()
            corner = self._root.translate_coords(window, 0, 0)
        except self._gone():
            return None
        return Area(corner.x, corner.y, size.width, size.height)

    @staticmethod
    def _gone() -> tuple[type[Exception], ...]:
        from Xlib import error

        return (error.BadWindow, error.BadDrawable)
