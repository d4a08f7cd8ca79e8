-- What leaves the box: what is on its way keeps its bytes, what has left is known with its time and place.

-- Plants are packed into tables once. The bytes stay until they were read back, so that neither a later plant nor a
-- newer program can make a second table of the same plants.
CREATE TABLE batches (
    seq        INTEGER PRIMARY KEY AUTOINCREMENT,
    plants_key TEXT NOT NULL,
    plants     BLOB NOT NULL,
    organs_key TEXT NOT NULL,
    organs     BLOB NOT NULL
) STRICT;

ALTER TABLE outbox ADD COLUMN batch INTEGER REFERENCES batches (seq);
-- How often it was tried, when last, and why it is still here.
ALTER TABLE outbox ADD COLUMN attempts INTEGER NOT NULL DEFAULT 0;
ALTER TABLE outbox ADD COLUMN last_try TEXT;
ALTER TABLE outbox ADD COLUMN reason TEXT;
CREATE INDEX outbox_batch ON outbox (batch);

-- Objects that a destination gave back with the hash of their key: they need not go there again. Those of a batch are
-- forgotten with it, species files are not.
CREATE TABLE uploads (
    destination TEXT NOT NULL,
    key         TEXT NOT NULL,
    batch       INTEGER REFERENCES batches (seq) ON DELETE CASCADE,
    time        TEXT NOT NULL,
    PRIMARY KEY (destination, key)
) STRICT, WITHOUT ROWID;
CREATE INDEX uploads_batch ON uploads (batch);

-- Plants that have left, with the table that they are in.
CREATE TABLE sent (
    plant       INTEGER PRIMARY KEY REFERENCES plants (seq),
    destination TEXT NOT NULL,
    object      TEXT NOT NULL,
    time        TEXT NOT NULL
) STRICT;
