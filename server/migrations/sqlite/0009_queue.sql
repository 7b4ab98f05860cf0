-- The queue's order, and the workers that it is given to.

ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 0 CHECK (priority BETWEEN -10 AND 10);
ALTER TABLE jobs ADD COLUMN memory INTEGER;        -- bytes that it takes at least; null where that is not known
ALTER TABLE jobs ADD COLUMN likely_memory INTEGER; -- bytes that it will probably take
ALTER TABLE jobs ADD COLUMN clip TEXT;             -- SHA-256 of the CLIP of its key

-- As they would be submitted now.
UPDATE jobs SET priority = 5 WHERE kind = 2;

-- The queue is found lane by lane. What a worker must have is in the index, so that jobs which it can't hold are passed
-- over without being read.
DROP INDEX jobs_queue;
CREATE INDEX jobs_queue ON jobs (project, priority, queue_time, id, run_after, memory, likely_memory, clip, state)
    WHERE state = 1;

-- When a lane was last served.
CREATE INDEX jobs_by_start ON jobs (project, priority, start_time) WHERE start_time IS NOT NULL;

CREATE TABLE seen_workers (
    name   TEXT    NOT NULL PRIMARY KEY,
    device TEXT    NOT NULL,
    memory INTEGER,          -- bytes that a job may take; null where the worker did not say
    clips  TEXT    NOT NULL, -- SHA-256 of those that it can load, with spaces between; empty for any
    time   INTEGER NOT NULL  -- when it was last seen
) STRICT;
