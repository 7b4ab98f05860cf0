-- Content credentials of marked scenes, found by what was marked, by the value that names the mark, and by manifest.
-- What is deleted, or not there yet, is so by the state of the artifact.

CREATE TABLE content_credentials (
    artifact_id      BLOB    NOT NULL PRIMARY KEY REFERENCES artifacts (id) ON DELETE CASCADE, -- the sidecar
    project          TEXT    NOT NULL,
    key_id           BLOB    NOT NULL,
    asset_id         BLOB   ,            -- the asset that was marked as; null for a message
    message          TEXT   ,            -- in hexadecimal; null for an asset, whose word is secret
    manifest         TEXT    NOT NULL, -- the identifier of the active one
    soft_binding     TEXT    NOT NULL, -- base64
    test_certificate INTEGER NOT NULL,
    create_time      INTEGER NOT NULL,
    CHECK ((asset_id IS NULL) <> (message IS NULL))
) STRICT;

CREATE INDEX content_credentials_by_asset ON content_credentials (asset_id, create_time, artifact_id) WHERE asset_id IS NOT NULL;
CREATE INDEX content_credentials_by_message ON content_credentials (key_id, message, create_time, artifact_id) WHERE message IS NOT NULL;
CREATE INDEX content_credentials_by_binding ON content_credentials (project, soft_binding, create_time, artifact_id);
CREATE INDEX content_credentials_by_manifest ON content_credentials (project, manifest, create_time, artifact_id);
