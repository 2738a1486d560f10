-- Takes a waiting job of a queue and leases it: a recovered one first, then the oldest.
-- One statement, because every stage of every job waits for it.
--
-- :queue     the queue
-- :owner     the worker's id
-- :duration  how long the lease is valid
-- :full      owners of jobs that are passed over
-- :only      owners whose jobs may be taken; null for everybody's
-- :version   the simulator's version that jobs must have been submitted for; null for any
-- :prefix    of a key's runners, what their ids begin with: jobs that they missed lately are passed
--            over; null for workers of the house
-- :last      the owner whose job was taken last: it comes after the others

-- Owners with a waiting job, in steps along the index: one probe each, however many jobs they have.
WITH RECURSIVE owners (name) AS (
    (SELECT coalesce(owner, '') FROM jobs WHERE state = 'queued' AND queue = :queue
     ORDER BY coalesce(owner, '') LIMIT 1)
    UNION ALL
    SELECT (
        SELECT coalesce(owner, '') FROM jobs
        WHERE state = 'queued' AND queue = :queue AND coalesce(owner, '') > owners.name
        ORDER BY coalesce(owner, '') LIMIT 1
    ) FROM owners WHERE owners.name IS NOT NULL
),

-- Those whose turn it may be, the next one first.
turns AS MATERIALIZED (
    SELECT name FROM owners
    WHERE name IS NOT NULL AND name <> ALL(CAST(:full AS text[]))
        AND (CAST(:only AS text[]) IS NULL OR name = ANY(CAST(:only AS text[])))
        AND (CAST(:version AS text) IS NULL OR EXISTS (
            SELECT FROM jobs
            WHERE state = 'queued' AND queue = :queue AND available_at <= clock_timestamp()
                AND coalesce(owner, '') = name
                AND track_config ->> 'simulation_version' = :version
        ))
    ORDER BY
        name IS NOT DISTINCT FROM CAST(:last AS text),
        name < coalesce(CAST(:last AS text), ''),
        name
),

-- The oldest recovered job of any owner, whose work was lost once already.
recovered AS MATERIALIZED (
    SELECT id FROM jobs
    WHERE state = 'queued' AND queue = :queue AND available_at <= clock_timestamp() AND faults > 0
        AND coalesce(owner, '') <> ALL(CAST(:full AS text[]))
        AND (CAST(:only AS text[]) IS NULL OR coalesce(owner, '') = ANY(CAST(:only AS text[])))
        AND (CAST(:version AS text) IS NULL OR track_config ->> 'simulation_version' = :version)
        AND (CAST(:prefix AS text) IS NULL OR NOT EXISTS ({missed_lately}))
    ORDER BY created_at, id LIMIT 1 FOR UPDATE SKIP LOCKED
),

-- The job itself, with a token that no earlier lease had.
taken AS (
    UPDATE jobs SET
        state = 'running',
        lease_owner = :owner,
        lease_token = lease_token + 1,
        started_at = coalesce(started_at, clock_timestamp())
    WHERE id = coalesce(
        (SELECT id FROM recovered),
        (SELECT oldest.id FROM turns CROSS JOIN LATERAL (
            SELECT id FROM jobs
            WHERE state = 'queued' AND queue = :queue AND available_at <= clock_timestamp()
                AND coalesce(owner, '') = turns.name
                AND (CAST(:version AS text) IS NULL
                    OR track_config ->> 'simulation_version' = :version)
                AND (CAST(:prefix AS text) IS NULL OR NOT EXISTS ({missed_lately}))
            ORDER BY created_at, id LIMIT 1 FOR UPDATE SKIP LOCKED
         ) AS oldest LIMIT 1)
    )
    RETURNING *
),

-- Until when the lease is valid: heartbeats change this narrow row alone.
leased AS (
    INSERT INTO leases (job_id, token, expires_at)
    SELECT id, lease_token, clock_timestamp() + :duration FROM taken
    ON CONFLICT (job_id) DO UPDATE SET token = excluded.token, expires_at = excluded.expires_at
),

attempted AS (
    INSERT INTO attempts (job_id, token, stage, worker)
    SELECT id, lease_token, stage, lease_owner FROM taken
),

recorded AS (
    INSERT INTO events (job_id, kind, data)
    SELECT id, state, jsonb_build_object('stage', stage, 'worker', lease_owner) FROM taken
)

-- The job, and whether a budget pays for it.
SELECT {columns}, model_config->>'provider' IS DISTINCT FROM 'builtin'
    AND EXISTS (SELECT FROM budgets WHERE budgets.id IN (payer, owner)) AS budgeted
FROM taken
