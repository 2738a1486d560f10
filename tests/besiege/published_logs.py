"""Logs as the published runner writes them, made up from paths."""


def sample(n: int, ids: dict[str, tuple[float, float, float]], state: dict[str, str]) -> list[str]:
    """The rows that one printing update leaves, in the order of printing."""
    t = f"{n / 100:.1f}"
    rows = []
    for name, (x, y, z) in ids.items():
        if name in state:
            rows.append(f"{t}, ID_{name}, {state[name]}")
        rows.append(f"{t}, ID_{name}, {x:.1f}, {y:.1f}, {z:.1f}")
    return rows


def printed(path, *, names, last, state=lambda _n: {}) -> list[str]:
    """All rows of a run in the order of printing."""
    places = {n: {name: path(name, n) for name in names} for n in range(4, last + 1, 4)}
    return [row for n, at in places.items() for row in sample(n, at, state(n))]


def copies(rows: list[str], *, window: int = 300, every: int = 100) -> str:
    """The file before it is cleaned: the window, newest row first, copied again and again."""
    told = []
    for end in range(every, len(rows) + every, every):
        told += reversed(rows[max(0, min(end, len(rows)) - window) : end])
    return "\n".join(told)


def cleaned(rows: list[str]) -> str:
    """The file after it was cleaned: each row once, in order of time."""
    return "\n".join(sorted(dict.fromkeys(rows), key=lambda row: float(row.split(",")[0])))
