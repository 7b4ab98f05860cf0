-- What is needed to delete by age, and to leave what must stay.

-- Signed reports stay, and their jobs with them. Those of before are known by the names that the server gives them.
ALTER TABLE artifacts ADD COLUMN evidence INTEGER NOT NULL DEFAULT 0;
UPDATE artifacts SET evidence = 1
    WHERE job_id IS NOT NULL AND secret = 0 AND display_name IN ('evidence.html', 'evidence.json');

CREATE INDEX jobs_by_end ON jobs (end_time) WHERE state >= 3;
CREATE INDEX assets_by_artifact ON assets (artifact_id) WHERE artifact_id IS NOT NULL;
