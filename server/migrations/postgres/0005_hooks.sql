-- Hooks: URLs that are told of jobs that are over, and what they are sent. A delivery is made in the transaction in which
-- its job is over. Times are microseconds since 1970, UTC. Columns are those of the SQLite ledger.

CREATE TABLE hooks (
    id            UUID    NOT NULL PRIMARY KEY,
    project       TEXT    NOT NULL,
    display_name  TEXT    NOT NULL,
    url           TEXT    NOT NULL,
    kinds         INTEGER NOT NULL, -- of jobs: the sum of 2 embed, 4 verify, 8 create key; 0: all
    states        INTEGER NOT NULL, -- of jobs: the sum of 8 succeeded, 16 failed, 32 cancelled; 0: all
    sealed_secret BYTEA   NOT NULL, -- under the master key
    create_time   BIGINT  NOT NULL
);

CREATE INDEX hooks_by_project ON hooks (project, create_time, id);

CREATE TABLE deliveries (
    id          UUID    NOT NULL PRIMARY KEY, -- of the event, too
    hook_id     UUID    NOT NULL REFERENCES hooks (id) ON DELETE CASCADE,
    project     TEXT    NOT NULL,
    job_id      UUID    NOT NULL,            -- which may be gone
    job_state   INTEGER NOT NULL,            -- 3 succeeded, 4 failed, 5 cancelled
    state       INTEGER NOT NULL DEFAULT 1,  -- 1 pending, 2 delivered, 3 dead
    attempts    INTEGER NOT NULL DEFAULT 0,  -- since `since`
    last_error  TEXT    NOT NULL DEFAULT '',
    create_time BIGINT  NOT NULL,
    since       BIGINT  NOT NULL,            -- when trying began, for the last time
    next_time   BIGINT  NOT NULL,            -- not sent before; while it is being sent, the end of the lease
    lease_token BYTEA,                       -- SHA-256 of the token of whoever is sending it
    last_time   BIGINT,
    end_time    BIGINT,
    CHECK (state BETWEEN 1 AND 3),
    CHECK ((state = 1) = (end_time IS NULL)),
    CHECK (state = 1 OR lease_token IS NULL)
);

CREATE INDEX deliveries_due ON deliveries (next_time, id) WHERE state = 1;
CREATE INDEX deliveries_over ON deliveries (end_time) WHERE state > 1;
CREATE INDEX deliveries_by_hook ON deliveries (hook_id, create_time, id);
CREATE INDEX deliveries_by_project ON deliveries (project, create_time, id);

-- What the caller called the request; `request_id` is that of all projects.
ALTER TABLE jobs ADD COLUMN asked_id UUID;
