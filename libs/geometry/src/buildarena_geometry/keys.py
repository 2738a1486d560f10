"""The keys a machine can be controlled by."""

KEYS = (
    "UpArrow",
    "DownArrow",
    "LeftArrow",
    "RightArrow",
    *(f"Alpha{digit}" for digit in range(10)),
    *(f"Keypad{digit}" for digit in range(10)),
)
KEYS_IN_WORDS = "UpArrow, DownArrow, LeftArrow, RightArrow, Alpha0 to Alpha9, Keypad0 to Keypad9"
