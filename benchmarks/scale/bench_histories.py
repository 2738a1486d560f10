"""Measures packing in a database with ten million rows of journal, calls and events.

100,000 scored jobs have 30 journal entries, 10 calls and 60 events each. Some are packed, as
`buildarena history pack` does it, some of these unpacked, and rows of further jobs take their
room.
"""

import argparse
import os
import sys
import tempfile
import time
from datetime import timedelta
from pathlib import Path
from typing import Any

from benchmarks.figures import keep
from benchmarks.scale.bench_scale import memory_mb, servers
from benchmarks.scale.filling import Amount, fill, without_indexes
from sqlalchemy import text

from buildarena_store import ArtifactStore, Database
from buildarena_store.jobs.histories import PACKED, Histories

ROWS = {"journal": 30, "external_calls": 10, "events": 60}
"""Of each job."""
OLD = timedelta(days=30)
"""Whatever ended so long ago is packed: all of it."""
TABLES = tuple(table.name for table in PACKED)


def add_rows(database: Database, *, first: int, jobs: int) -> None:
    """Gives jobs, counted in the order of their ids, rows of the usual sizes."""
    with database.engine.connect() as connection:
        connection.execution_options(isolation_level="AUTOCOMMIT")
        connection.execute(text("SET session_replication_role = replica"))
        given = {"first": first, "jobs": jobs}
        for table, number in ROWS.items():
            connection.execute(text(FILLINGS[table]), {**given, "last": number - 1})


def fill_all(database: Database, jobs: int) -> None:
    """Ended jobs with all their rows; indexes are made at the end."""
    fill(database, Amount(ended=jobs, queued=0))
    with database.engine.connect() as connection:
        connection.execution_options(isolation_level="AUTOCOMMIT")
        with without_indexes(connection, TABLES):
            add_rows(database, first=0, jobs=jobs)
        connection.execute(text("VACUUM ANALYZE"))


def sizes_mb(database: Database) -> dict[str, float]:
    """Tables with their indexes and texts."""
    with database.statement() as connection:
        return {
            name: round(connection.execute(text(SIZE), {"name": name}).scalar_one() / 1e6, 1)
            for name in TABLES
        }


def vacuum(database: Database) -> float:
    """Seconds that it took to give room back to further rows."""
    start = time.perf_counter()
    with database.engine.connect() as connection:
        connection.execution_options(isolation_level="AUTOCOMMIT")
        for name in TABLES:
            connection.execute(text(f"VACUUM {name}"))
    return time.perf_counter() - start


def pack(histories: Histories, at_least: int) -> tuple[int, int, int]:
    """Packs so many jobs, the first by id; returns how many jobs, rows and bytes they were."""
    jobs = rows = size = 0
    for one in histories.pack_all(OLD):
        jobs, rows, size = jobs + one.jobs, rows + one.rows, size + one.bytes
        if jobs >= at_least:
            break
    return jobs, rows, size


def measure(folder: Path, *, jobs: int, packed: int, unpacked: int) -> dict[str, Any]:
    """Fills a database, packs, unpacks, and fills the room again."""
    with servers(folder) as settings:
        database = Database(settings["BUILDARENA_DATABASE_URL"])
        start = time.perf_counter()
        fill_all(database, jobs)
        filled = time.perf_counter() - start
        before = sizes_mb(database)
        histories = Histories(database, ArtifactStore(str(folder / "artifacts")))

        start = time.perf_counter()
        waiting = histories.waiting(OLD)
        counted = time.perf_counter() - start

        start, cpu = time.perf_counter(), time.process_time()
        done, rows, size = pack(histories, packed)
        packing, used = time.perf_counter() - start, time.process_time() - cpu

        with database.statement() as connection:
            names = connection.execute(text(NEWLY_PACKED), {"limit": unpacked}).scalars().all()
        start = time.perf_counter()
        back = histories.unpack(names)
        unpacking = time.perf_counter() - start
        pack(histories, back)

        vacuuming = vacuum(database)
        add_rows(database, first=0, jobs=done)
        vacuum(database)
        after = sizes_mb(database)
        database.close()
    whole = sum(before.values())
    return {
        "jobs": jobs,
        "rows": jobs * sum(ROWS.values()),
        "fill_s": round(filled),
        "tables_mb": before,
        "kb_of_a_job_in_rows": round(1e3 * whole / jobs, 1),
        "kb_of_a_job_packed": round(size / done / 1e3, 1),
        "counting_what_waits_s": round(counted, 2),
        "waiting": waiting,
        "packed": done,
        "packed_a_second": round(done / packing),
        "rows_a_second": round(rows / packing),
        "own_processor_ms_a_job": round(1e3 * used / done, 2),
        "unpacked_a_second": round(back / unpacking),
        "vacuum_s": round(vacuuming, 1),
        "grown_mb_when_the_room_is_filled_again": round(sum(after.values()) - whole, 1),
        "mb_of_what_filled_it": round(whole * done / jobs, 1),
        "memory_mb": round(memory_mb(os.getpid())),
        "load_average": [round(value, 1) for value in os.getloadavg()],
    }


SIZE = "SELECT pg_total_relation_size(CAST(:name AS regclass))"
NEWLY_PACKED = "SELECT job_id FROM job_artifacts WHERE name = 'history' LIMIT :limit"
CHOSEN = """
WITH chosen AS (
    SELECT id, row_number() OVER (ORDER BY id) AS n FROM jobs
    ORDER BY id OFFSET :first LIMIT :jobs
)
"""
FILLINGS = {
    "journal": CHOSEN
    + """
INSERT INTO journal (job_id, sequence, token, stage, role, request_hash, reply, input_tokens,
    output_tokens, cost_usd, latency_s, payer, owner, told)
SELECT id, k, 1, 'construct', 'builder', md5(id || k) || md5(k || id),
    json_build_object('text', 'I attach the beam to face ' || k % 6 || ' of block ' || k,
        'calls', json_build_array(json_build_object('name', 'attach_block_to',
            'arguments', md5(id || k || 'a') || md5(id || k || 'b') || md5(id || k || 'c'))),
        'raw', (SELECT string_agg(md5(id || k || r), '') FROM generate_series(1, 12) AS r)),
    9000, 300, 0.01, 4.5, 'sweep_1', 'key_1',
    json_build_array('block ' || k || ' was attached')
FROM chosen, generate_series(0, :last) AS k
ON CONFLICT DO NOTHING
""",
    "external_calls": CHOSEN
    + """
INSERT INTO external_calls (job_id, sequence, machine, tool, arguments, ok, feedback)
SELECT id, k, 'main', 'attach_block_to', json_build_object('base_block', k, 'face', 'A'), true,
    'attached small wooden block as block ' || k || ' at (0, 1, ' || k || ')'
FROM chosen, generate_series(0, :last) AS k
ON CONFLICT DO NOTHING
""",
    "events": CHOSEN
    + """
INSERT INTO events (job_id, kind, data)
SELECT id, CASE WHEN k % 2 = 0 THEN 'turn' ELSE 'running' END,
    jsonb_build_object('stage', 'construct', 'results',
        jsonb_build_array(jsonb_build_array('attach', true, 'attached as block ' || k)))
FROM chosen, generate_series(0, :last) AS k
""",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--jobs", type=int, default=100_000, help="of 100 rows each")
    parser.add_argument("--packed", type=int, default=10_000)
    parser.add_argument("--unpacked", type=int, default=500)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(
        prefix="buildarena-bench-", ignore_cleanup_errors=True
    ) as name:
        result = measure(Path(name), jobs=given.jobs, packed=given.packed, unpacked=given.unpacked)
    for figure, value in result.items():
        sys.stdout.write(f"{figure:<40} {value}\n")
    keep(result, given.json)


if __name__ == "__main__":
    main()
