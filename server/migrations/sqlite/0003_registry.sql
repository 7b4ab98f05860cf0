-- The registry: owners, their assets, and the chain of commitments. Times are microseconds since 1970, UTC.

ALTER TABLE keys ADD COLUMN state INTEGER NOT NULL DEFAULT 1 CHECK (state BETWEEN 1 AND 3); -- 1 active, 2 retired, 3 revoked
ALTER TABLE keys ADD COLUMN state_reason TEXT NOT NULL DEFAULT '';
ALTER TABLE keys ADD COLUMN state_time INTEGER; -- null while it is active

CREATE TABLE signing_keys (
    id          INTEGER NOT NULL PRIMARY KEY CHECK (id = 1), -- there is one
    public_key  BLOB    NOT NULL CHECK (length(public_key) = 32),
    sealed      BLOB    NOT NULL, -- under the master key
    create_time INTEGER NOT NULL
) STRICT;

CREATE TABLE owners (
    id           BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    display_name TEXT    NOT NULL,
    request_id   BLOB    UNIQUE,
    create_time  INTEGER NOT NULL
) STRICT;

CREATE INDEX owners_by_time ON owners (create_time, id);

CREATE TABLE assets (
    id           BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    owner_id     BLOB    NOT NULL REFERENCES owners (id),
    display_name TEXT    NOT NULL,
    sha256       BLOB    NOT NULL CHECK (length(sha256) = 32),
    artifact_id  BLOB,             -- the artifact that the hash was taken from, which may be gone
    key_id       BLOB    NOT NULL REFERENCES keys (id),
    payload      INTEGER NOT NULL CHECK (payload > 0),
    sealed_nonce BLOB    NOT NULL, -- nonce and blinding, under the master key
    request_id   BLOB    UNIQUE,
    create_time  INTEGER NOT NULL,
    UNIQUE (key_id, payload)
) STRICT;

CREATE INDEX assets_by_time ON assets (create_time, id);
CREATE INDEX assets_by_owner ON assets (owner_id, create_time, id);
CREATE INDEX assets_by_key ON assets (key_id, create_time, id);

CREATE TABLE commitments (
    sequence  INTEGER NOT NULL PRIMARY KEY CHECK (sequence > 0),
    id        BLOB    NOT NULL UNIQUE CHECK (length(id) = 16),
    asset_id  BLOB    NOT NULL UNIQUE REFERENCES assets (id),
    canonical BLOB    NOT NULL, -- the bytes that are hashed
    hash      BLOB    NOT NULL UNIQUE CHECK (length(hash) = 32),
    signature BLOB    NOT NULL CHECK (length(signature) = 64)
) STRICT;

-- A mistake of this program, or a hand that slips, changes none of them. Whoever means to can drop these; then the
-- chain shows it.
CREATE TRIGGER commitments_never_change BEFORE UPDATE ON commitments
BEGIN
    SELECT RAISE(ABORT, 'commitments never change');
END;
CREATE TRIGGER commitments_never_go BEFORE DELETE ON commitments
BEGIN
    SELECT RAISE(ABORT, 'commitments never go');
END;
