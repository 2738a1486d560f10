-- What SQLAlchemy has no words for: storage, and the log of board changes.

ALTER TABLE jobs SET (fillfactor = 90);
ALTER TABLE leases SET (fillfactor = 10);

DO $$ DECLARE large text; BEGIN
    FOREACH large IN ARRAY ARRAY['jobs', 'attempts', 'journal'] LOOP
        EXECUTE format('ALTER TABLE %I SET (autovacuum_vacuum_scale_factor = 0.02,
            autovacuum_vacuum_insert_scale_factor = 0.05, autovacuum_analyze_scale_factor = 0.02)', large);
    END LOOP;
END $$;

CREATE FUNCTION log_board_change() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
DECLARE
    scored CONSTANT text[] := ARRAY['success', 'unsuccessful', 'construction_failed'];
    job jobs%ROWTYPE;
    was boolean := false;
    is_now boolean := false;
    kind text;
BEGIN
    IF TG_OP <> 'INSERT' AND OLD.state = 'done' THEN
        was := OLD.outcome = ANY (scored) AND COALESCE(OLD.audit, 'verified') = 'verified';
        job := OLD;
    END IF;
    IF TG_OP <> 'DELETE' AND NEW.state = 'done' THEN
        is_now := NEW.outcome = ANY (scored) AND COALESCE(NEW.audit, 'verified') = 'verified';
        job := NEW;
    END IF;
    kind := CASE
        WHEN is_now AND NOT was THEN 'entered'
        WHEN was AND NOT is_now THEN 'left'
        WHEN was AND is_now THEN 'changed'
        ELSE 'unscored' END;
    INSERT INTO board_changes (transaction, job_id, track, task, task_version, configuration,
        kind)
    VALUES (pg_current_xact_id()::text::bigint, job.id, job.track, job.task, job.task_version,
            CASE WHEN job.model_config->>'provider' = 'file' THEN NULL ELSE job.model_hash END,
            kind);
    RETURN NULL;
END $$;

CREATE TRIGGER log_board_delete AFTER DELETE ON jobs FOR EACH ROW
    WHEN (OLD.state = 'done') EXECUTE FUNCTION log_board_change();
CREATE TRIGGER log_board_insert AFTER INSERT ON jobs FOR EACH ROW
    WHEN (NEW.state = 'done') EXECUTE FUNCTION log_board_change();
CREATE TRIGGER log_board_update AFTER UPDATE ON jobs FOR EACH ROW
    WHEN ((OLD.state = 'done' OR NEW.state = 'done') AND
        (OLD.state, OLD.outcome, OLD.reason, OLD.success, OLD.indicator, OLD.metrics,
        OLD.flags, OLD.refusals, OLD.requests, OLD.input_tokens, OLD.output_tokens,
        OLD.cost_usd, OLD.actions, OLD.refused_actions, OLD.finished_at, OLD.audit,
        OLD.ran_on_runner)
        IS DISTINCT FROM
        (NEW.state, NEW.outcome, NEW.reason, NEW.success, NEW.indicator, NEW.metrics,
        NEW.flags, NEW.refusals, NEW.requests, NEW.input_tokens, NEW.output_tokens,
        NEW.cost_usd, NEW.actions, NEW.refused_actions, NEW.finished_at, NEW.audit,
        NEW.ran_on_runner))
    EXECUTE FUNCTION log_board_change();
