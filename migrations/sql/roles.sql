-- Rights of the roles: one for each kind of process, a group without a password. The tables' owner
-- gives them after each migration, to the roles that the server has and that had none left.

-- role api: accounts, submissions, runners' trials, imports, boards
GRANT SELECT ON ALL TABLES IN SCHEMA public TO buildarena_api;
GRANT INSERT ON api_keys, artifacts, attempts, board_changes, budgets, events, external_calls,
    job_artifacts, job_claims, jobs, journal, leases, names, reservations, rollouts, sweep_jobs,
    sweeps, tasks, verifications, workers TO buildarena_api;
GRANT UPDATE ON api_keys, artifacts, attempts, board_changes, budgets, external_calls,
    job_artifacts, job_claims, jobs, leases, names, reservations, rollouts, sweep_jobs, sweeps,
    tasks, verifications, workers TO buildarena_api;
GRANT DELETE ON job_artifacts, job_claims, leases, reservations, workers TO buildarena_api;

-- role construct: sessions, their costs, verifications
GRANT SELECT ON alembic_version, artifacts, attempts, board_changes, budgets, events,
    external_calls, job_artifacts, job_claims, jobs, journal, leases, reservations, rollouts,
    schema_compatibility, sweep_jobs, sweeps, tasks, verifications, workers
    TO buildarena_construct;
GRANT INSERT ON artifacts, attempts, board_changes, events, external_calls, job_artifacts, journal,
    leases, reservations, rollouts, verifications, workers TO buildarena_construct;
GRANT UPDATE ON artifacts, attempts, job_artifacts, jobs, leases, reservations, rollouts,
    verifications, workers TO buildarena_construct;
GRANT UPDATE (lost_cost_usd, lost_requests, spent_cost_usd, spent_requests, spent_tokens)
    ON budgets TO buildarena_construct;
-- A sweep whose budget is used up is stopped by the worker that finds it so.
GRANT UPDATE (state) ON sweeps TO buildarena_construct;
-- A verification that refutes a runner's trial suspends its key.
GRANT SELECT (id, suspended_at, suspended_for), UPDATE (suspended_at, suspended_for)
    ON api_keys TO buildarena_construct;
-- Every process removes leases: its reaper may end them.
GRANT DELETE ON job_artifacts, leases, reservations, workers TO buildarena_construct;

-- role simulate: trials and their scores
GRANT SELECT ON alembic_version, artifacts, attempts, board_changes, budgets, events,
    external_calls, job_artifacts, job_claims, jobs, leases, reservations, rollouts,
    schema_compatibility, sweep_jobs, sweeps, tasks, verifications, workers
    TO buildarena_simulate;
-- Trials in varied worlds are requested when the exact one is done.
GRANT INSERT ON artifacts, attempts, board_changes, events, job_artifacts, leases, rollouts,
    verifications, workers TO buildarena_simulate;
GRANT UPDATE ON artifacts, attempts, job_artifacts, jobs, leases, rollouts, verifications, workers
    TO buildarena_simulate;
GRANT UPDATE (lost_cost_usd, lost_requests) ON budgets TO buildarena_simulate;
GRANT DELETE ON job_artifacts, leases, reservations, workers TO buildarena_simulate;

-- role reader: reports and dumps
GRANT SELECT ON ALL TABLES IN SCHEMA public TO buildarena_reader;
