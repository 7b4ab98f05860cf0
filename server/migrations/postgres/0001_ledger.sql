-- The ledger: jobs, the artifacts they read and make, keys, and the registry with its chain of commitments. Times are
-- microseconds since 1970, UTC. Columns are those of the SQLite ledger.

CREATE TABLE jobs (
    id                    UUID    NOT NULL PRIMARY KEY,
    display_name          TEXT    NOT NULL,
    kind                  INTEGER NOT NULL, -- 1 embed, 2 verify, 3 create key
    spec                  BYTEA   NOT NULL,
    key_id                UUID,
    request_id            UUID    UNIQUE,
    fingerprint           BYTEA   NOT NULL,
    state                 INTEGER NOT NULL, -- 1 queued, 2 running, 3 succeeded, 4 failed, 5 cancelled
    cancel_requested      BOOLEAN NOT NULL DEFAULT false,
    attempt               INTEGER NOT NULL DEFAULT 0,
    max_attempts          INTEGER NOT NULL,
    progress              BYTEA,
    result                BYTEA,
    failure_reason        INTEGER,
    failure_message       TEXT,
    create_time           BIGINT  NOT NULL,
    update_time           BIGINT  NOT NULL,
    start_time            BIGINT,
    end_time              BIGINT,
    run_after             BIGINT,
    queue_time            BIGINT  NOT NULL, -- the place in the queue: when the job was made, or may run again
    revision              BIGINT  NOT NULL DEFAULT 1,
    worker                TEXT,
    lease_token           BYTEA,            -- SHA-256 of the token
    lease_expires         BIGINT,
    completed_token       BYTEA,            -- SHA-256 of the token of the attempt that completed it
    completed_fingerprint BYTEA,            -- of what that attempt said came out
    CHECK (state BETWEEN 1 AND 5),
    CHECK ((state = 2) = (lease_token IS NOT NULL)),
    CHECK ((state = 2) = (lease_expires IS NOT NULL)),
    CHECK ((state >= 3) = (end_time IS NOT NULL)),
    CHECK ((state = 3) = (result IS NOT NULL)),
    CHECK ((failure_reason IS NULL) = (failure_message IS NULL))
);

CREATE INDEX jobs_by_time ON jobs (create_time, id);
CREATE INDEX jobs_by_state ON jobs (state, create_time, id);
CREATE INDEX jobs_by_key ON jobs (key_id) WHERE key_id IS NOT NULL;
CREATE INDEX jobs_queue ON jobs (queue_time, id) WHERE state = 1;
CREATE INDEX jobs_leases ON jobs (lease_expires) WHERE state = 2;

CREATE TABLE artifacts (
    id           UUID    NOT NULL PRIMARY KEY,
    display_name TEXT    NOT NULL,
    size         BIGINT  NOT NULL,
    sha256       TEXT    NOT NULL,
    job_id       UUID    REFERENCES jobs (id), -- null: an upload
    lease_token  BYTEA,                        -- SHA-256 of the token of the attempt that made it
    secret       BOOLEAN NOT NULL,
    path         TEXT    NOT NULL,
    state        INTEGER NOT NULL,             -- 1 pending, 2 stored, 3 ready, 4 deleted
    create_time  BIGINT  NOT NULL,
    update_time  BIGINT  NOT NULL,
    CHECK (state BETWEEN 1 AND 4),
    CHECK ((job_id IS NULL) = (lease_token IS NULL))
);

CREATE INDEX artifacts_by_state ON artifacts (state, create_time);
CREATE INDEX artifacts_by_job ON artifacts (job_id) WHERE job_id IS NOT NULL;

CREATE TABLE job_inputs (
    artifact_id UUID NOT NULL REFERENCES artifacts (id) ON DELETE CASCADE,
    job_id      UUID NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    PRIMARY KEY (artifact_id, job_id)
);

CREATE INDEX job_inputs_by_job ON job_inputs (job_id);

CREATE TABLE keys (
    id           UUID    NOT NULL PRIMARY KEY,
    display_name TEXT    NOT NULL,
    bits         INTEGER NOT NULL,
    clip         TEXT    NOT NULL,
    clip_sha256  TEXT    NOT NULL,
    seeded       BOOLEAN NOT NULL,
    create_time  BIGINT  NOT NULL,
    job_id       UUID    NOT NULL REFERENCES jobs (id),
    artifact_id  UUID    NOT NULL UNIQUE REFERENCES artifacts (id),
    state        INTEGER NOT NULL DEFAULT 1 CHECK (state BETWEEN 1 AND 3), -- 1 active, 2 retired, 3 revoked
    state_reason TEXT    NOT NULL DEFAULT '',
    state_time   BIGINT -- null while it is active
);

CREATE INDEX keys_by_time ON keys (create_time, id);
CREATE INDEX keys_by_job ON keys (job_id);

ALTER TABLE jobs ADD FOREIGN KEY (key_id) REFERENCES keys (id);

CREATE TABLE signing_keys (
    id          INTEGER NOT NULL PRIMARY KEY CHECK (id = 1), -- there is one
    public_key  BYTEA   NOT NULL CHECK (length(public_key) = 32),
    sealed      BYTEA   NOT NULL, -- under the master key
    create_time BIGINT  NOT NULL
);

CREATE TABLE owners (
    id           UUID   NOT NULL PRIMARY KEY,
    display_name TEXT   NOT NULL,
    request_id   UUID   UNIQUE,
    create_time  BIGINT NOT NULL
);

CREATE INDEX owners_by_time ON owners (create_time, id);

CREATE TABLE assets (
    id           UUID   NOT NULL PRIMARY KEY,
    owner_id     UUID   NOT NULL REFERENCES owners (id),
    display_name TEXT   NOT NULL,
    sha256       BYTEA  NOT NULL CHECK (length(sha256) = 32),
    artifact_id  UUID,            -- the artifact that the hash was taken from, which may be gone
    key_id       UUID   NOT NULL REFERENCES keys (id),
    payload      BIGINT NOT NULL CHECK (payload > 0),
    sealed_nonce BYTEA  NOT NULL, -- nonce and blinding, under the master key
    request_id   UUID   UNIQUE,
    create_time  BIGINT NOT NULL,
    UNIQUE (key_id, payload)
);

CREATE INDEX assets_by_time ON assets (create_time, id);
CREATE INDEX assets_by_owner ON assets (owner_id, create_time, id);
CREATE INDEX assets_by_key ON assets (key_id, create_time, id);

CREATE TABLE commitments (
    sequence  BIGINT NOT NULL PRIMARY KEY CHECK (sequence > 0),
    id        UUID   NOT NULL UNIQUE,
    asset_id  UUID   NOT NULL UNIQUE REFERENCES assets (id),
    canonical BYTEA  NOT NULL, -- the bytes that are hashed
    hash      BYTEA  NOT NULL UNIQUE CHECK (length(hash) = 32),
    signature BYTEA  NOT NULL CHECK (length(signature) = 64)
);

-- A mistake of this program, or a hand that slips, changes none of them. Whoever means to can drop these; then the
-- chain shows it.
CREATE FUNCTION commitments_stay() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION 'commitments never change, and never go';
END;
$$;
CREATE TRIGGER commitments_stay BEFORE UPDATE OR DELETE ON commitments
    FOR EACH ROW EXECUTE FUNCTION commitments_stay();
CREATE TRIGGER commitments_stay_all BEFORE TRUNCATE ON commitments
    FOR EACH STATEMENT EXECUTE FUNCTION commitments_stay();

-- When a server last looked after leases, by which one that begins knows whether workers had anybody to report to.
CREATE TABLE presence (
    id   INTEGER NOT NULL PRIMARY KEY CHECK (id = 1), -- there is one
    time BIGINT  NOT NULL
);
INSERT INTO presence (id, time) VALUES (1, 0);

-- Tells all servers of a change, when it is committed: who made it (the setting guardsplat.server of the connection),
-- the job, and what it means for the queue. An extended lease is no news, so the revision does not move, and none is
-- told.
CREATE FUNCTION jobs_announce() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
    queue TEXT := 'same';
BEGIN
    IF TG_OP = 'INSERT' THEN
        queue := 'grew';
    ELSIF NEW.revision = OLD.revision THEN
        RETURN NULL;
    ELSIF NEW.state = 1 THEN
        queue := 'back';
    ELSIF OLD.state = 1 THEN
        queue := 'moved';
    END IF;
    PERFORM pg_notify(
        'guardsplat_jobs',
        concat_ws(' ', coalesce(nullif(current_setting('guardsplat.server', true), ''), '-'), NEW.id, queue));
    RETURN NULL;
END;
$$;
CREATE TRIGGER jobs_announce AFTER INSERT OR UPDATE ON jobs FOR EACH ROW EXECUTE FUNCTION jobs_announce();
