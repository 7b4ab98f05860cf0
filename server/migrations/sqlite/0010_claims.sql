-- What a claim is weighed with: when the files of a suspect were first seen, and how often they were read.

-- Kept although the artifacts may go. Hashes are lower-case hexadecimal, as those of artifacts are.
CREATE TABLE seen_files (
    project TEXT    NOT NULL,
    sha256  TEXT    NOT NULL,
    time    INTEGER NOT NULL, -- when the file first came
    PRIMARY KEY (project, sha256)
) STRICT, WITHOUT ROWID;

INSERT INTO seen_files (project, sha256, time)
SELECT project, sha256, min(create_time) FROM artifacts WHERE job_id IS NULL AND state > 1 GROUP BY project, sha256;

-- Readings that differ in files, key or views; one that was made again is the same.
CREATE TABLE readings (
    id      BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 32), -- SHA-256 of all that decides what is read
    project TEXT    NOT NULL,
    key_id  BLOB    NOT NULL,
    time    INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE INDEX readings_by_key ON readings (key_id);

CREATE TABLE read_files (
    project    TEXT NOT NULL,
    sha256     TEXT NOT NULL,
    reading_id BLOB NOT NULL REFERENCES readings (id),
    PRIMARY KEY (project, sha256, reading_id)
) STRICT, WITHOUT ROWID;

CREATE INDEX read_files_by_reading ON read_files (reading_id);

-- When the commitment was first opened for somebody; null while nonce and blinding are secret.
ALTER TABLE assets ADD COLUMN reveal_time INTEGER;
