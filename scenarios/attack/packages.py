"""Packages of challenges that mean harm: bombs, gigabytes, links, encodings, numbers."""

from __future__ import annotations

import io
import stat
import zipfile
from collections import Counter
from collections.abc import Iterator
from typing import Final

import httpx
from scenarios.attack.arena import Arena, Tried
from support.challenge import package_files, packed, zipped
from support.servers.stacks import wait_until

ENTRY: Final = {"season": "s01-stable-orbit", "track": "autopilot"}
RAW, FLIGHT, HISTORY = "machine_raw.bsg", "trajectory.csv", "build_history.json"
ROUNDS: Final = 3
GROWN_MIB: Final = 40.0
"""By so much memory may differ between the first round and the last."""
GIBI: Final = 1 << 30
LAUGHS: Final = "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10 if k else "ha"}">' for k in range(10))


def hostile(bomb_mib: int) -> Iterator[tuple[str, bytes]]:
    """Files by what is wrong with them."""
    good = package_files("three_blocks")

    def changed(name: str, content: bytes) -> bytes:
        return zipped({**good, name: content})

    text = good[FLIGHT].decode()
    head, *rows = [line for line in text.splitlines() if not line.startswith("#")]
    yield "no archive", b"PK nonsense"
    yield "cut", packed()[:2000]
    yield "bomb", changed(FLIGHT, b"0" * (bomb_mib << 20))
    yield "many files", zipped({f"{k}.txt": b"" for k in range(5000)})
    yield "path", zipped({f"../../{name}": data for name, data in good.items()})
    yield "link", _linked(good)
    yield "entities", changed(RAW, f"<!DOCTYPE m [{LAUGHS}]><Machine>&l9;</Machine>".encode())
    yield "depth", changed(HISTORY, b"[" * 500_000)
    yield "digits", changed(HISTORY, b"[" + b"9" * 5_000_000 + b"]")
    yield "encoding", changed(HISTORY, good[HISTORY].decode().encode("utf-16"))
    yield "bytes", changed(RAW, bytes(range(256)) * 4096)
    for number in ("nan", "inf", "1e308", "-1e308"):
        cells = rows[0].split(",")
        cells[16] = number
        flight = "\n".join([head, ",".join(cells), *rows[1:], ""])
        yield number, changed(FLIGHT, flight.encode())
    yield "one line", changed(FLIGHT, b"," * (8 << 20))


def _linked(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in files.items():
            if name != RAW:
                archive.writestr(name, data)
        link = zipfile.ZipInfo(RAW)
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "/etc/passwd")
    return out.getvalue()


def hostile_packages(arena: Arena) -> Tried:
    """Every hostile package, round after round, and ten gigabytes in one body."""
    tries = dict(hostile(int(arena.sizes["bomb_mib"])))
    found = Tried(f"{len(tries)} hostile packages, {ROUNDS} times, and a body of 10 GiB")
    ends: Counter[str] = Counter()
    memory = []
    for round_number in range(ROUNDS):
        for name, data in tries.items():
            # Another comment is another file: none is known from the round before.
            end = _handed_in(arena, f"{name} {round_number}", data + bytes([round_number]))
            ends[end] += 1
            found.require(end != "scored", f"{name} was scored")
        memory.append(arena.memory()["api"])
    found.require(
        memory[-1] - memory[0] < GROWN_MIB, f"memory of the API went {[round(m) for m in memory]}"
    )
    status = _gigabytes(arena)
    found.require(status in {0, 413}, f"ten gigabytes were answered by {status}")
    honest = _handed_in(arena, "honest", packed(note=str(len(ends))))
    found.require(honest == "scored", f"an honest package was {honest} then")
    found.refused = f"ends {dict(ends)}, ten gigabytes {status or 'cut off'}, memory {memory}"
    return found


def _handed_in(arena: Arena, name: str, data: bytes) -> str:
    """What came of a package: its state, or the status that refused it."""
    answer = arena.operator.ask(
        "POST",
        "/v1/submissions",
        params={**ENTRY, "name": name},
        content=data,
        headers={"Content-Type": "application/zip"},
    )
    if answer.status_code != httpx.codes.CREATED:
        return str(answer.status_code)
    place = f"/v1/submissions/{answer.json()['id']}"

    def ended() -> str | None:
        state = str(arena.operator.get(place)["state"])
        return None if state in {"received", "checking"} else state

    return str(wait_until(ended, 120, f"{name} was checked"))


def _gigabytes(arena: Arena) -> int:
    """The status of a body of ten gigabytes; 0 where it was cut off."""
    chunk = b"0" * (1 << 20)
    try:
        return arena.operator.ask(
            "POST",
            "/v1/submissions",
            params={**ENTRY, "name": "gigabytes"},
            content=(chunk for _ in range(10 * GIBI // len(chunk))),
            headers={"Content-Type": "application/zip"},
        ).status_code
    except httpx.TransportError:
        return 0
