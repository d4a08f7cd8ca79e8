-- Plants at a BrAPI server (its url and study); those without a line have not been tried.
CREATE TABLE brapi (
    plant       INTEGER NOT NULL REFERENCES plants (seq),
    destination TEXT NOT NULL,
    -- The server's id of the observation unit, and when all was read back there; until then empty.
    unit        TEXT,
    sent        TEXT,
    -- How often it was tried, when last, and why it is not there.
    attempts    INTEGER NOT NULL DEFAULT 0,
    last_try    TEXT,
    reason      TEXT,
    PRIMARY KEY (plant, destination)
) STRICT, WITHOUT ROWID;
