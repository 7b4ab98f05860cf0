-- The job ledger: jobs, the artifacts they read and make, and keys. Times are microseconds since 1970, UTC.

CREATE TABLE jobs (
    id               BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    display_name     TEXT    NOT NULL,
    kind             INTEGER NOT NULL, -- 1 embed, 2 verify, 3 create key
    spec             BLOB    NOT NULL,
    key_id           BLOB    REFERENCES keys (id),
    request_id       BLOB    UNIQUE,
    fingerprint      BLOB    NOT NULL,
    state            INTEGER NOT NULL, -- 1 queued, 2 running, 3 succeeded, 4 failed, 5 cancelled
    cancel_requested INTEGER NOT NULL DEFAULT 0,
    attempt          INTEGER NOT NULL DEFAULT 0,
    max_attempts     INTEGER NOT NULL,
    progress         BLOB,
    result           BLOB,
    failure_reason   INTEGER,
    failure_message  TEXT,
    create_time      INTEGER NOT NULL,
    update_time      INTEGER NOT NULL,
    start_time       INTEGER,
    end_time         INTEGER,
    run_after        INTEGER,
    queue_time       INTEGER NOT NULL, -- the place in the queue: when the job was made, or may run again
    revision         INTEGER NOT NULL DEFAULT 1,
    worker           TEXT,
    lease_token      BLOB,             -- SHA-256 of the token
    lease_expires    INTEGER,
    CHECK (state BETWEEN 1 AND 5),
    CHECK ((state = 2) = (lease_token IS NOT NULL)),
    CHECK ((state = 2) = (lease_expires IS NOT NULL)),
    CHECK ((state >= 3) = (end_time IS NOT NULL)),
    CHECK ((state = 3) = (result IS NOT NULL)),
    CHECK ((failure_reason IS NULL) = (failure_message IS NULL))
) STRICT;

CREATE INDEX jobs_by_time ON jobs (create_time, id);
CREATE INDEX jobs_by_state ON jobs (state, create_time, id);
CREATE INDEX jobs_by_key ON jobs (key_id) WHERE key_id IS NOT NULL;
CREATE INDEX jobs_queue ON jobs (queue_time, id) WHERE state = 1;
CREATE INDEX jobs_leases ON jobs (lease_expires) WHERE state = 2;

CREATE TABLE artifacts (
    id           BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    display_name TEXT    NOT NULL,
    size         INTEGER NOT NULL,
    sha256       TEXT    NOT NULL,
    job_id       BLOB    REFERENCES jobs (id), -- null: an upload
    lease_token  BLOB,                         -- SHA-256 of the token of the attempt that made it
    secret       INTEGER NOT NULL,
    path         TEXT    NOT NULL,
    state        INTEGER NOT NULL,             -- 1 pending, 2 stored, 3 ready, 4 deleted
    create_time  INTEGER NOT NULL,
    update_time  INTEGER NOT NULL,
    CHECK (state BETWEEN 1 AND 4),
    CHECK ((job_id IS NULL) = (lease_token IS NULL))
) STRICT;

CREATE INDEX artifacts_by_state ON artifacts (state, create_time);
CREATE INDEX artifacts_by_job ON artifacts (job_id) WHERE job_id IS NOT NULL;

CREATE TABLE job_inputs (
    artifact_id BLOB NOT NULL REFERENCES artifacts (id) ON DELETE CASCADE,
    job_id      BLOB NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    PRIMARY KEY (artifact_id, job_id)
) STRICT, WITHOUT ROWID;

CREATE INDEX job_inputs_by_job ON job_inputs (job_id);

CREATE TABLE keys (
    id           BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    display_name TEXT    NOT NULL,
    bits         INTEGER NOT NULL,
    clip         TEXT    NOT NULL,
    clip_sha256  TEXT    NOT NULL,
    seeded       INTEGER NOT NULL,
    create_time  INTEGER NOT NULL,
    job_id       BLOB    NOT NULL REFERENCES jobs (id),
    artifact_id  BLOB    NOT NULL UNIQUE REFERENCES artifacts (id)
) STRICT;

CREATE INDEX keys_by_time ON keys (create_time, id);
CREATE INDEX keys_by_job ON keys (job_id);
