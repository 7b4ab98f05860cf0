-- Deliveries: what one says never changes, and one project's do not hold up those of others.

ALTER TABLE deliveries ADD COLUMN body BLOB; -- what is sent, since the first attempt; null before

-- Whose they are is in the index, so that those of a project which has enough under way are passed over without being
-- read.
DROP INDEX deliveries_due;
CREATE INDEX deliveries_due ON deliveries (next_time, id, project, hook_id) WHERE state = 1;
CREATE INDEX deliveries_waiting ON deliveries (project) WHERE state = 1;

-- Which generation of the artifact store the ledger belongs to. The store names it too, so a ledger that is a copy, and
-- does not know how the store went on, is not taken for its owner.
CREATE TABLE store_generation (
    id       INTEGER NOT NULL PRIMARY KEY CHECK (id = 1), -- there is one
    current  BLOB    NOT NULL CHECK (length(current) = 16),
    previous BLOB    CHECK (length(previous) = 16), -- null: there was none
    time     INTEGER NOT NULL -- when the current one began
) STRICT;
