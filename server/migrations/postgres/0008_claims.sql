-- What a claim is weighed with: when the files of a suspect were first seen, and how often they were read.
-- Columns are those of the SQLite ledger.

-- Kept although the artifacts may go. Hashes are lower-case hexadecimal, as those of artifacts are.
CREATE TABLE seen_files (
    project TEXT   NOT NULL,
    sha256  TEXT   NOT NULL,
    time    BIGINT NOT NULL, -- when the file first came
    PRIMARY KEY (project, sha256)
);

INSERT INTO seen_files (project, sha256, time)
SELECT project, sha256, min(create_time) FROM artifacts WHERE job_id IS NULL AND state > 1 GROUP BY project, sha256;

-- Readings that differ in files, key or views; one that was made again is the same.
CREATE TABLE readings (
    id      BYTEA  NOT NULL PRIMARY KEY CHECK (octet_length(id) = 32), -- SHA-256 of all that decides what is read
    project TEXT   NOT NULL,
    key_id  UUID   NOT NULL,
    time    BIGINT NOT NULL
);

CREATE INDEX readings_by_key ON readings (key_id);

CREATE TABLE read_files (
    project    TEXT  NOT NULL,
    sha256     TEXT  NOT NULL,
    reading_id BYTEA NOT NULL REFERENCES readings (id),
    PRIMARY KEY (project, sha256, reading_id)
);

CREATE INDEX read_files_by_reading ON read_files (reading_id);

-- When the commitment was first opened for somebody; null while nonce and blinding are secret.
ALTER TABLE assets ADD COLUMN reveal_time BIGINT;
