-- Bytes that uploads which go to the store by themselves may take of their project, from when they are begun. Columns are
-- those of the SQLite ledger.

CREATE TABLE upload_reservations (
    id          UUID   NOT NULL PRIMARY KEY, -- of the artifact to be
    project     TEXT   NOT NULL,
    size        BIGINT NOT NULL CHECK (size > 0),
    address_end BIGINT NOT NULL, -- when nobody can send any more
    end_time    BIGINT NOT NULL  -- when what was sent goes, and the bytes are given back
);

CREATE INDEX upload_reservations_by_project ON upload_reservations (project, size);
CREATE INDEX upload_reservations_by_end ON upload_reservations (end_time);
