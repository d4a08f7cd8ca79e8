-- The first layout. Times are RFC 3339 UTC text as the box believed them, lengths metres, angles radians.

CREATE TABLE rigs (
    id TEXT PRIMARY KEY
) STRICT;

CREATE TABLE sessions (
    id      TEXT PRIMARY KEY,
    rig     TEXT NOT NULL REFERENCES rigs (id)
) STRICT;

-- A camera is the camera of one session: its calibration may differ in the next.
CREATE TABLE cameras (
    session     TEXT NOT NULL REFERENCES sessions (id),
    id          TEXT NOT NULL,
    calibration TEXT NOT NULL CHECK (json_valid(calibration)),
    PRIMARY KEY (session, id)
) STRICT, WITHOUT ROWID;

CREATE TABLE models (
    sha256 TEXT PRIMARY KEY CHECK (length(sha256) = 64),
    name   TEXT NOT NULL
) STRICT;

-- Every species file ever used: records hold standard deviations of its bases, so without it they mean nothing.
CREATE TABLE species (
    hash TEXT PRIMARY KEY CHECK (length(hash) = 64),
    name TEXT NOT NULL,
    file BLOB NOT NULL
) STRICT;

CREATE TABLE plants (
    -- Order of arrival; never used twice, so that a cursor never lies.
    seq          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    -- BLAKE3 of everything saved with the plant: the same id with another body is refused.
    body         BLOB NOT NULL CHECK (length(body) = 32),
    session      TEXT NOT NULL REFERENCES sessions (id),
    species      TEXT NOT NULL REFERENCES species (hash),
    record       BLOB NOT NULL,
    time         TEXT NOT NULL,
    time_trusted INTEGER NOT NULL CHECK (time_trusted IN (0, 1)),
    scale_source TEXT NOT NULL
        CHECK (scale_source IN ('stereo', 'ground_plane', 'target', 'metric_model', 'input', 'none')),
    -- The main stem's base in the session's world.
    x REAL, y REAL, z REAL,
    -- WGS 84 degrees, where the rig had a fix.
    latitude REAL, longitude REAL,
    -- The traits that lists show; all of them are in `traits`.
    height REAL, leaf_count REAL, blade_count REAL, leaf_area REAL,
    cd           REAL,
    traits       TEXT NOT NULL CHECK (json_valid(traits)),
    warnings     TEXT NOT NULL CHECK (json_valid(warnings)),
    provenance   TEXT NOT NULL CHECK (json_valid(provenance)),
    -- PNG: the photo's crop beside the fitted plant.
    thumbnail    BLOB
) STRICT;

CREATE TABLE organs (
    plant            INTEGER NOT NULL REFERENCES plants (seq),
    id               INTEGER NOT NULL,
    kind             TEXT NOT NULL CHECK (kind IN ('main_stem', 'stem', 'leaf')),
    parent           INTEGER,
    leaf             INTEGER,
    points           INTEGER,
    residual         REAL,
    visible_fraction REAL,
    traits           TEXT NOT NULL CHECK (json_valid(traits)),
    PRIMARY KEY (plant, id),
    FOREIGN KEY (plant, parent) REFERENCES organs (plant, id)
) STRICT, WITHOUT ROWID;

-- The networks that a plant went through.
CREATE TABLE plant_models (
    plant INTEGER NOT NULL REFERENCES plants (seq),
    model TEXT NOT NULL REFERENCES models (sha256),
    PRIMARY KEY (plant, model)
) STRICT, WITHOUT ROWID;

-- The frames that a plant was seen in.
CREATE TABLE observations (
    plant   INTEGER NOT NULL REFERENCES plants (seq),
    session TEXT NOT NULL,
    camera  TEXT NOT NULL,
    frame   INTEGER NOT NULL,
    PRIMARY KEY (plant, camera, frame),
    FOREIGN KEY (session, camera) REFERENCES cameras (session, id)
) STRICT, WITHOUT ROWID;

-- What is still to be sent, one row a plant.
CREATE TABLE outbox (
    seq   INTEGER PRIMARY KEY AUTOINCREMENT,
    plant INTEGER NOT NULL UNIQUE REFERENCES plants (seq)
) STRICT;

-- What happened: timings, gaps, dropped frames. Never part of a plant, so that two replays write the same records.
CREATE TABLE events (
    seq     INTEGER PRIMARY KEY AUTOINCREMENT,
    time    TEXT NOT NULL,
    kind    TEXT NOT NULL,
    detail  TEXT NOT NULL CHECK (json_valid(detail))
) STRICT;
