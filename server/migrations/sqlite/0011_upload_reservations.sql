-- Bytes that uploads which go to the store by themselves may take of their project, from when they are begun.

CREATE TABLE upload_reservations (
    id          BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 16), -- of the artifact to be
    project     TEXT    NOT NULL,
    size        INTEGER NOT NULL CHECK (size > 0),
    address_end INTEGER NOT NULL, -- when nobody can send any more
    end_time    INTEGER NOT NULL  -- when what was sent goes, and the bytes are given back
) STRICT;

CREATE INDEX upload_reservations_by_project ON upload_reservations (project, size);
CREATE INDEX upload_reservations_by_end ON upload_reservations (end_time);
