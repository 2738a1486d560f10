-- What SQLAlchemy has no words for: storage, counters of jobs, and the log of board changes.

ALTER TABLE jobs SET (fillfactor = 90);
ALTER TABLE leases SET (fillfactor = 10);

DO $$ DECLARE large text; BEGIN
    FOREACH large IN ARRAY ARRAY['jobs', 'attempts', 'journal', 'figure_changes'] LOOP
        EXECUTE format('ALTER TABLE %I SET (autovacuum_vacuum_scale_factor = 0.02,
            autovacuum_vacuum_insert_scale_factor = 0.05, autovacuum_analyze_scale_factor = 0.02)', large);
    END LOOP;
END $$;

CREATE FUNCTION attempt_class(seconds double precision) RETURNS integer
    LANGUAGE sql IMMUTABLE
    AS $$
    SELECT width_bucket(seconds, ARRAY[0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120, 300, 600,
        1800, 3600]::double precision[])
$$;

CREATE FUNCTION count_attempt_ended() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
DECLARE
    seconds CONSTANT double precision := extract(epoch FROM NEW.ended_at - NEW.started_at);
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('stages', jsonb_build_array(NEW.stage, NEW.result, attempt_class(seconds)),
        1, seconds, 0, 0);
    RETURN NULL;
END $$;

CREATE FUNCTION count_audits_added() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'audits', jsonb_build_array(audit), count(*), 0, 0, 0 FROM added
    WHERE audit IS NOT NULL GROUP BY 2;
    RETURN NULL;
END $$;

CREATE FUNCTION count_job_audited() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'audits', jsonb_build_array(audit), number, 0, 0, 0
    FROM (VALUES (OLD.audit, -1), (NEW.audit, 1)) AS moved (audit, number)
    WHERE audit IS NOT NULL;
    RETURN NULL;
END $$;

CREATE FUNCTION count_job_lost() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'sweep_lost', jsonb_build_array(sweep_id), NEW.lost_requests - OLD.lost_requests, 0, 0,
        0 FROM sweep_jobs WHERE job_id = NEW.id;
    RETURN NULL;
END $$;

CREATE FUNCTION count_job_moved() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('jobs', job_place(OLD), -1, 0, 0, 0), ('jobs', job_place(NEW), 1, 0, 0, 0);
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'sweep_jobs', sweep_place(sweep_id, OLD), -1, 0, 0, 0 FROM sweep_jobs
        WHERE job_id = NEW.id;
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'sweep_jobs', sweep_place(sweep_id, NEW), 1, 0, 0, 0 FROM sweep_jobs
        WHERE job_id = NEW.id;
    RETURN NULL;
END $$;

CREATE FUNCTION count_job_use() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('models', jsonb_build_array(NEW.model), NEW.requests - OLD.requests,
        NEW.input_tokens - OLD.input_tokens, NEW.output_tokens - OLD.output_tokens,
        NEW.cost_usd - OLD.cost_usd);
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'sweep_use', jsonb_build_array(sweep_id), NEW.requests - OLD.requests,
        NEW.input_tokens - OLD.input_tokens, NEW.output_tokens - OLD.output_tokens,
        NEW.cost_usd - OLD.cost_usd FROM sweep_jobs WHERE job_id = NEW.id;
    RETURN NULL;
END $$;

CREATE FUNCTION count_jobs_added() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'jobs', job_place(added), count(*), 0, 0, 0 FROM added GROUP BY 2;
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'models', jsonb_build_array(model), sum(requests), sum(input_tokens),
        sum(output_tokens), sum(cost_usd) FROM added GROUP BY 2;
    RETURN NULL;
END $$;

CREATE FUNCTION count_jobs_removed() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'jobs', job_place(removed), -count(*), 0, 0, 0 FROM removed GROUP BY 2;
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'models', jsonb_build_array(model), -sum(requests), -sum(input_tokens),
        -sum(output_tokens), -sum(cost_usd) FROM removed GROUP BY 2;
    RETURN NULL;
END $$;

CREATE FUNCTION count_members_added() RETURNS trigger
    LANGUAGE plpgsql
    SET enable_hashjoin TO 'off'
    SET enable_mergejoin TO 'off'
    AS $$
BEGIN
    PERFORM 1 FROM jobs JOIN added ON added.job_id = jobs.id
    WHERE jobs.xmin <> pg_current_xact_id()::xid ORDER BY jobs.id FOR SHARE OF jobs;
    WITH places AS MATERIALIZED (
        SELECT sweep_id, sweep_place(sweep_id, jobs) AS place, count(*) AS number,
            sum(requests) AS requests, sum(input_tokens) AS input_tokens,
            sum(output_tokens) AS output_tokens, sum(cost_usd) AS cost_usd,
            sum(lost_requests) AS lost_requests
        FROM added AS member JOIN jobs ON jobs.id = member.job_id GROUP BY 1, 2
    )
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'sweep_jobs', place, 1 * number, 0, 0, 0 FROM places
    UNION ALL SELECT 'sweep_use', jsonb_build_array(sweep_id), 1 * sum(requests),
        1 * sum(input_tokens), 1 * sum(output_tokens), 1 * sum(cost_usd)
        FROM places GROUP BY sweep_id
    UNION ALL SELECT 'sweep_lost', jsonb_build_array(sweep_id), 1 * sum(lost_requests), 0, 0, 0
    FROM places GROUP BY sweep_id;
    RETURN NULL;
END $$;

CREATE FUNCTION count_members_removed() RETURNS trigger
    LANGUAGE plpgsql
    SET enable_hashjoin TO 'off'
    SET enable_mergejoin TO 'off'
    AS $$
BEGIN
    WITH places AS MATERIALIZED (
        SELECT sweep_id, sweep_place(sweep_id, jobs) AS place, count(*) AS number,
            sum(requests) AS requests, sum(input_tokens) AS input_tokens,
            sum(output_tokens) AS output_tokens, sum(cost_usd) AS cost_usd,
            sum(lost_requests) AS lost_requests
        FROM removed AS member JOIN jobs ON jobs.id = member.job_id GROUP BY 1, 2
    )
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'sweep_jobs', place, -1 * number, 0, 0, 0 FROM places
    UNION ALL SELECT 'sweep_use', jsonb_build_array(sweep_id), -1 * sum(requests),
        -1 * sum(input_tokens), -1 * sum(output_tokens), -1 * sum(cost_usd)
        FROM places GROUP BY sweep_id
    UNION ALL SELECT 'sweep_lost', jsonb_build_array(sweep_id), -1 * sum(lost_requests), 0, 0, 0
    FROM places GROUP BY sweep_id;
    RETURN NULL;
END $$;

CREATE FUNCTION count_verification_ended() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('verifications', jsonb_build_array(NEW.verdict), 1, 0, 0, 0);
    RETURN NULL;
END $$;

CREATE FUNCTION job_place(job jobs) RETURNS jsonb
    LANGUAGE sql IMMUTABLE
    AS $$
    SELECT jsonb_build_array(job.state, job.stage, COALESCE(job.outcome, ''),
        CASE WHEN job.outcome = 'errored' THEN COALESCE(job.reason, '') ELSE '' END,
        CASE WHEN job.state = 'queued' THEN job.queue ELSE '' END)
$$;

CREATE FUNCTION log_board_change() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
DECLARE
    scored CONSTANT text[] := ARRAY['success', 'unsuccessful', 'construction_failed', 'limit'];
    old_score jsonb;
    new_score jsonb;
    job jobs%ROWTYPE;
    was boolean := false;
    is_now boolean := false;
    kind text;
BEGIN
    IF TG_OP <> 'INSERT' AND OLD.state = 'done' THEN
        was := OLD.outcome = ANY (scored) AND COALESCE(OLD.audit, 'verified') = 'verified';
        old_score := jsonb_build_object('outcome', OLD.outcome, 'reason', OLD.reason,
            'success', OLD.success, 'indicator', OLD.indicator, 'flags', OLD.flags);
        job := OLD;
    END IF;
    IF TG_OP <> 'DELETE' AND NEW.state = 'done' THEN
        is_now := NEW.outcome = ANY (scored) AND COALESCE(NEW.audit, 'verified') = 'verified';
        new_score := jsonb_build_object('outcome', NEW.outcome, 'reason', NEW.reason,
            'success', NEW.success, 'indicator', NEW.indicator, 'flags', NEW.flags);
        job := NEW;
    END IF;
    kind := CASE
        WHEN is_now AND NOT was THEN 'entered'
        WHEN was AND NOT is_now THEN 'left'
        WHEN was AND is_now AND old_score IS DISTINCT FROM new_score THEN 'rescored'
        WHEN was AND is_now THEN 'corrected'
        ELSE 'unscored' END;
    INSERT INTO board_changes (transaction, job_id, track, task, task_version, configuration,
        model, kind, before, after, why)
    VALUES (pg_current_xact_id()::text::bigint, job.id, job.track, job.task, job.task_version,
            CASE WHEN job.model_config->>'provider' = 'file' THEN NULL ELSE job.model_hash END,
            job.model, kind, old_score, new_score,
            NULLIF(current_setting('buildarena.why', true), ''));
    RETURN NULL;
END $$;

CREATE FUNCTION sweep_place(sweep text, job jobs) RETURNS jsonb
    LANGUAGE sql IMMUTABLE
    AS $$ SELECT jsonb_build_array(sweep, job.state, job.stage, COALESCE(job.outcome, '')) $$;

CREATE FUNCTION recount_jobs() RETURNS void
    LANGUAGE sql
    AS $$ DELETE FROM figure_changes; DELETE FROM figures;
    INSERT INTO figures SELECT 'jobs', job_place(jobs), count(*), 0, 0, 0 FROM jobs GROUP BY 2;
    INSERT INTO figures SELECT 'models', jsonb_build_array(model), sum(requests),
        sum(input_tokens), sum(output_tokens), sum(cost_usd) FROM jobs GROUP BY 2;
    INSERT INTO figures SELECT 'stages', jsonb_build_array(stage, result, attempt_class(seconds)),
        count(*), sum(seconds), 0, 0
    FROM (SELECT stage, result, extract(epoch FROM ended_at - started_at)::double precision
        AS seconds FROM attempts WHERE ended_at IS NOT NULL) AS took GROUP BY 2;
    INSERT INTO figures SELECT 'verifications', jsonb_build_array(verdict), count(*), 0, 0, 0
    FROM verifications WHERE verdict IS NOT NULL GROUP BY 2;
    INSERT INTO figures SELECT 'audits', jsonb_build_array(audit), count(*), 0, 0, 0
    FROM jobs WHERE audit IS NOT NULL GROUP BY 2;
    INSERT INTO figures (kind, key, a, b, c, d)
    SELECT 'sweep_jobs', sweep_place(sweep_id, jobs), 1 * count(*), 0, 0, 0
        FROM sweep_jobs AS member JOIN jobs ON jobs.id = member.job_id GROUP BY 2;
    INSERT INTO figures (kind, key, a, b, c, d)
    SELECT 'sweep_use', jsonb_build_array(sweep_id), 1 * sum(requests), 1 * sum(input_tokens),
        1 * sum(output_tokens), 1 * sum(cost_usd)
        FROM sweep_jobs AS member JOIN jobs ON jobs.id = member.job_id GROUP BY 2;
    INSERT INTO figures (kind, key, a, b, c, d)
    SELECT 'sweep_lost', jsonb_build_array(sweep_id), 1 * sum(lost_requests), 0, 0, 0
        FROM sweep_jobs AS member JOIN jobs ON jobs.id = member.job_id GROUP BY 2;
     $$;

CREATE TRIGGER count_attempts_added AFTER INSERT ON attempts FOR EACH ROW
    WHEN ((new.ended_at IS NOT NULL)) EXECUTE FUNCTION count_attempt_ended();
CREATE TRIGGER count_attempts_ended AFTER UPDATE ON attempts FOR EACH ROW
    WHEN (((old.ended_at IS NULL)
    AND (new.ended_at IS NOT NULL))) EXECUTE FUNCTION count_attempt_ended();
CREATE TRIGGER count_audits_added AFTER INSERT ON jobs REFERENCING NEW TABLE AS added
    FOR EACH STATEMENT EXECUTE FUNCTION count_audits_added();
CREATE TRIGGER count_jobs_added AFTER INSERT ON jobs REFERENCING NEW TABLE AS added
    FOR EACH STATEMENT EXECUTE FUNCTION count_jobs_added();
CREATE TRIGGER count_jobs_audited AFTER UPDATE ON jobs FOR EACH ROW
    WHEN ((old.audit IS DISTINCT FROM new.audit)) EXECUTE FUNCTION count_job_audited();
CREATE TRIGGER count_jobs_lost AFTER UPDATE ON jobs FOR EACH ROW
    WHEN ((old.lost_requests <> new.lost_requests)) EXECUTE FUNCTION count_job_lost();
CREATE TRIGGER count_jobs_moved AFTER UPDATE ON jobs FOR EACH ROW
    WHEN ((((((old.state IS DISTINCT FROM new.state) OR (old.stage IS DISTINCT
    FROM new.stage)) OR (old.outcome IS DISTINCT
    FROM new.outcome)) OR (old.reason IS DISTINCT FROM new.reason)) OR (old.queue IS DISTINCT
    FROM new.queue))) EXECUTE FUNCTION count_job_moved();
CREATE TRIGGER count_jobs_removed AFTER DELETE ON jobs REFERENCING OLD TABLE AS removed
    FOR EACH STATEMENT EXECUTE FUNCTION count_jobs_removed();
CREATE TRIGGER count_jobs_used AFTER UPDATE ON jobs FOR EACH ROW
    WHEN (((((old.requests IS DISTINCT FROM new.requests) OR (old.input_tokens IS DISTINCT
    FROM new.input_tokens)) OR (old.output_tokens IS DISTINCT
    FROM new.output_tokens)) OR (old.cost_usd IS DISTINCT
    FROM new.cost_usd))) EXECUTE FUNCTION count_job_use();
CREATE TRIGGER count_members_added AFTER INSERT ON sweep_jobs REFERENCING NEW TABLE AS added
    FOR EACH STATEMENT EXECUTE FUNCTION count_members_added();
CREATE TRIGGER count_members_removed AFTER DELETE ON sweep_jobs REFERENCING OLD TABLE AS removed
    FOR EACH STATEMENT EXECUTE FUNCTION count_members_removed();
CREATE TRIGGER count_verifications_ended AFTER UPDATE ON verifications FOR EACH ROW
    WHEN (((old.verdict IS NULL)
    AND (new.verdict IS NOT NULL))) EXECUTE FUNCTION count_verification_ended();
CREATE TRIGGER log_board_delete AFTER DELETE ON jobs FOR EACH ROW
    WHEN (OLD.state = 'done') EXECUTE FUNCTION log_board_change();
CREATE TRIGGER log_board_insert AFTER INSERT ON jobs FOR EACH ROW
    WHEN (NEW.state = 'done') EXECUTE FUNCTION log_board_change();
CREATE TRIGGER log_board_update AFTER UPDATE ON jobs FOR EACH ROW
    WHEN ((OLD.state = 'done' OR NEW.state = 'done') AND
        (OLD.state, OLD.outcome, OLD.reason, OLD.success, OLD.indicator, OLD.metrics,
        OLD.flags, OLD.refusals, OLD.requests, OLD.input_tokens, OLD.output_tokens,
        OLD.cost_usd, OLD.actions, OLD.refused_actions, OLD.finished_at, OLD.audit,
        OLD.by_runner)
        IS DISTINCT FROM
        (NEW.state, NEW.outcome, NEW.reason, NEW.success, NEW.indicator, NEW.metrics,
        NEW.flags, NEW.refusals, NEW.requests, NEW.input_tokens, NEW.output_tokens,
        NEW.cost_usd, NEW.actions, NEW.refused_actions, NEW.finished_at, NEW.audit,
        NEW.by_runner))
    EXECUTE FUNCTION log_board_change();
