-- Tokens: who may call, for which project, and what. Times are microseconds since 1970, UTC. Columns are those of the
-- SQLite ledger.

CREATE TABLE tokens (
    id            UUID    NOT NULL PRIMARY KEY,
    hash          BYTEA   NOT NULL UNIQUE CHECK (length(hash) = 32), -- SHA-256 of the token, which is kept nowhere
    display_name  TEXT    NOT NULL,
    project       TEXT    NOT NULL,
    scopes        INTEGER NOT NULL CHECK (scopes BETWEEN 1 AND 15),  -- the sum of 1 embed, 2 verify, 4 admin, 8 worker
    create_time   BIGINT  NOT NULL,
    expire_time   BIGINT, -- null: never
    last_use_time BIGINT, -- to the minute; null: never
    revoke_time   BIGINT  -- null while it may be used
);

CREATE INDEX tokens_by_project ON tokens (project, create_time, id);
