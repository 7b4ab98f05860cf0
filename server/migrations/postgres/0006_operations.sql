-- For operators: what became of the attempts of a job, and which trace a job belongs to. Times are microseconds since
-- 1970, UTC. Columns are those of the SQLite ledger.

ALTER TABLE jobs ADD COLUMN trace_parent TEXT; -- W3C traceparent of the request; null: nobody traces it

CREATE INDEX jobs_failed ON jobs (kind, failure_reason) WHERE state = 4;

CREATE TABLE job_attempts (
    job_id          UUID    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    number          INTEGER NOT NULL CHECK (number > 0), -- counts what workers were given, whatever it counted for
    worker          TEXT    NOT NULL,
    start_time      BIGINT  NOT NULL,
    end_time        BIGINT,
    outcome         INTEGER NOT NULL DEFAULT 0 CHECK (outcome BETWEEN 0 AND 4), -- 0 under way, 1 succeeded, 2 failed, 3 cancelled, 4 released
    failure_reason  INTEGER,
    failure_message TEXT,
    PRIMARY KEY (job_id, number),
    CHECK ((outcome = 0) = (end_time IS NULL)),
    CHECK ((failure_reason IS NULL) = (failure_message IS NULL))
);

-- Kept by the database itself, so that no way in which a job comes to a worker or leaves it can be forgotten.
CREATE FUNCTION job_attempts_keep() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
    newest INTEGER;
BEGIN
    IF NEW.state = 2 THEN
        SELECT coalesce(max(number), 0) + 1 INTO newest FROM job_attempts WHERE job_id = NEW.id;
        INSERT INTO job_attempts (job_id, number, worker, start_time)
        VALUES (NEW.id, newest, coalesce(NEW.worker, ''), NEW.start_time);
        -- The newest 20.
        DELETE FROM job_attempts WHERE job_id = NEW.id AND number <= newest - 20;
    ELSIF OLD.state = 2 THEN
        UPDATE job_attempts SET end_time = NEW.update_time,
            outcome = CASE NEW.state WHEN 3 THEN 1 WHEN 5 THEN 3 WHEN 4 THEN 2
                ELSE CASE WHEN NEW.attempt < OLD.attempt THEN 4 ELSE 2 END END,
            failure_reason = NEW.failure_reason, failure_message = NEW.failure_message
        WHERE job_id = NEW.id AND outcome = 0;
    END IF;
    RETURN NULL;
END;
$$;
CREATE TRIGGER job_attempts_keep AFTER UPDATE OF state ON jobs
    FOR EACH ROW WHEN (OLD.state <> NEW.state) EXECUTE FUNCTION job_attempts_keep();
