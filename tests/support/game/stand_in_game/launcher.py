"""A launcher as Steam's: it starts the game in the background and ends."""

import subprocess
import sys
from pathlib import Path


def main() -> None:
    """Starts a game with the options after the first, a file that counts the games it started."""
    counts, *options = sys.argv[1:]
    with Path(counts).open("a") as file:
        file.write("started\n")
    subprocess.Popen(
        [sys.executable, "-m", "support.game.stand_in_game", *options],
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


main()
