-- For operators: what became of the attempts of a job, and which trace a job belongs to. Times are microseconds since
-- 1970, UTC.

ALTER TABLE jobs ADD COLUMN trace_parent TEXT; -- W3C traceparent of the request; null: nobody traces it

CREATE INDEX jobs_failed ON jobs (kind, failure_reason) WHERE state = 4;

CREATE TABLE job_attempts (
    job_id          BLOB    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    number          INTEGER NOT NULL CHECK (number > 0), -- counts what workers were given, whatever it counted for
    worker          TEXT    NOT NULL,
    start_time      INTEGER NOT NULL,
    end_time        INTEGER,
    outcome         INTEGER NOT NULL DEFAULT 0 CHECK (outcome BETWEEN 0 AND 4), -- 0 under way, 1 succeeded, 2 failed, 3 cancelled, 4 released
    failure_reason  INTEGER,
    failure_message TEXT,
    PRIMARY KEY (job_id, number),
    CHECK ((outcome = 0) = (end_time IS NULL)),
    CHECK ((failure_reason IS NULL) = (failure_message IS NULL))
) STRICT, WITHOUT ROWID;

-- Kept by the database itself, so that no way in which a job comes to a worker or leaves it can be forgotten.
CREATE TRIGGER job_attempts_begin AFTER UPDATE OF state ON jobs WHEN NEW.state = 2 AND OLD.state <> 2
BEGIN
    INSERT INTO job_attempts (job_id, number, worker, start_time)
    SELECT NEW.id, coalesce(max(number), 0) + 1, coalesce(NEW.worker, ''), NEW.start_time
    FROM job_attempts WHERE job_id = NEW.id;
    -- The newest 20.
    DELETE FROM job_attempts WHERE job_id = NEW.id
        AND number <= (SELECT max(number) FROM job_attempts WHERE job_id = NEW.id) - 20;
END;
CREATE TRIGGER job_attempts_end AFTER UPDATE OF state ON jobs WHEN OLD.state = 2 AND NEW.state <> 2
BEGIN
    UPDATE job_attempts SET end_time = NEW.update_time,
        outcome = CASE NEW.state WHEN 3 THEN 1 WHEN 5 THEN 3 WHEN 4 THEN 2 ELSE iif(NEW.attempt < OLD.attempt, 4, 2) END,
        failure_reason = NEW.failure_reason, failure_message = NEW.failure_message
    WHERE job_id = NEW.id AND outcome = 0;
END;
