-- Queues in which jobs wait now, each with how many, counted up to :most: in steps along the index,
-- one probe for each queue, however many jobs it has.
WITH RECURSIVE queues (name) AS (
    (SELECT queue FROM jobs WHERE state = 'queued' ORDER BY queue LIMIT 1)
    UNION ALL
    SELECT (
        SELECT queue FROM jobs WHERE state = 'queued' AND queue > queues.name
        ORDER BY queue LIMIT 1
    ) FROM queues WHERE queues.name IS NOT NULL
)
SELECT name, (
    SELECT count(*) FROM (
        SELECT FROM jobs
        WHERE state = 'queued' AND queue = queues.name AND available_at <= clock_timestamp()
        LIMIT :most
    ) AS waiting
) AS jobs
FROM queues WHERE name IS NOT NULL
