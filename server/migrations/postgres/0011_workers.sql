-- Operators see the workers, and which of them are old.

ALTER TABLE seen_workers ADD COLUMN version text NOT NULL DEFAULT ''; -- empty where the worker did not say
