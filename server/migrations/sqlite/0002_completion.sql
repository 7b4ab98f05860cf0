-- Who completed a job, and with what: so that a worker whose answer was lost may say it again.

ALTER TABLE jobs ADD COLUMN completed_token BLOB;       -- SHA-256 of the token of the attempt
ALTER TABLE jobs ADD COLUMN completed_fingerprint BLOB; -- of what the attempt said came out
