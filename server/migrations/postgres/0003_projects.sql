-- Projects: whose everything is. What was made before there were any is the project's that a server without tokens has.

ALTER TABLE jobs ADD COLUMN project TEXT NOT NULL DEFAULT 'default';
ALTER TABLE artifacts ADD COLUMN project TEXT NOT NULL DEFAULT 'default';
ALTER TABLE keys ADD COLUMN project TEXT NOT NULL DEFAULT 'default';
ALTER TABLE owners ADD COLUMN project TEXT NOT NULL DEFAULT 'default';
ALTER TABLE assets ADD COLUMN project TEXT NOT NULL DEFAULT 'default';

-- Lists are of a project.
DROP INDEX jobs_by_time;
DROP INDEX jobs_by_state;
DROP INDEX keys_by_time;
DROP INDEX owners_by_time;
DROP INDEX assets_by_time;
CREATE INDEX jobs_by_time ON jobs (project, create_time, id);
CREATE INDEX jobs_by_state ON jobs (project, state, create_time, id);
CREATE INDEX keys_by_time ON keys (project, create_time, id);
CREATE INDEX owners_by_time ON owners (project, create_time, id);
CREATE INDEX assets_by_time ON assets (project, create_time, id);

-- What a project's artifacts take.
CREATE INDEX artifacts_by_project ON artifacts (project, state, size);
