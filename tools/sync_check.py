"""Reads a bucket and a folder back with DuckDB and pyarrow and compares them with the store they came from.

Usage: sync_check.py DEMETER STORE FOLDER ENDPOINT BUCKET/PREFIX; the bucket's keys come from the environment as Garage
wants them. Everything that differs ends it with an error.
"""

import json
import os
import pathlib
import sqlite3
import struct
import subprocess
import sys
import tempfile

import duckdb
import pyarrow.dataset
import pyarrow.fs
import pyarrow.parquet
import s3fs

# The query that docs/sync.md documents; {root} is the bucket with its prefix, or the folder.
QUERY = """
SELECT rig, date, species, count(*) AS plants, avg(height) AS height_m, avg(leaf_area) AS leaf_area_m2
FROM read_parquet('{root}/plants/*/*/*.parquet', hive_partitioning = true)
GROUP BY ALL ORDER BY ALL
"""


def point(wkb):
    """Longitude and latitude of a WKB point."""
    order, kind, longitude, latitude = struct.unpack("<BIdd", wkb)
    assert (order, kind) == (1, 1), wkb
    return longitude, latitude


def check(demeter, store, root, files, duck):
    """One place: `files` opens it for pyarrow, `duck` queries it."""
    rows = store.execute("SELECT id, record, height, latitude, longitude, thumbnail FROM plants ORDER BY id").fetchall()
    organs = store.execute("SELECT count(*) FROM organs").fetchone()[0]
    assert rows and organs, "the store is empty"

    answer = duck.sql(QUERY.format(root=root))
    print(answer)
    assert sum(row[3] for row in answer.fetchall()) == len(rows)
    counted = duck.sql(f"SELECT count(*) FROM read_parquet('{root}/organs/*/*/*.parquet')").fetchone()[0]
    assert counted == organs, (counted, organs)

    plain = root.removeprefix("s3://")
    plants = pyarrow.dataset.dataset(f"{plain}/plants", filesystem=files, partitioning="hive")
    table = plants.to_table()
    # A dataset joins its files' columns and drops what they say of themselves.
    schema = pyarrow.parquet.read_schema(plants.files[0], filesystem=files)
    geo = json.loads(schema.metadata[b"geo"])
    assert geo["version"] == "1.1.0" and geo["columns"]["geometry"]["encoding"] == "WKB", geo
    height = schema.field("height").metadata
    assert height[b"unit"] == b"m" and b"CO_336:0000258" in height[b"ontology"], height
    found = sorted(table.to_pylist(), key=lambda row: row["id"])
    assert [row["id"] for row in found] == [row[0] for row in rows]
    for row, (_, record, height, latitude, longitude, thumbnail) in zip(found, rows):
        assert row["record"] == record and row["height"] == height, row["id"]
        where = row["geometry"] and point(row["geometry"])
        assert where == (None if latitude is None else (longitude, latitude)), (row["id"], where)
        with files.open_input_file(f"{plain}/blobs/{row['thumbnail']}.png") as file:
            assert file.read() == thumbnail, row["id"]
    assert any(row["geometry"] for row in found) and not all(row["geometry"] for row in found)

    # A record out of the bucket, decoded with the species file out of the bucket.
    with tempfile.TemporaryDirectory() as folder:
        record, species = pathlib.Path(folder, "plant.dmtr"), pathlib.Path(folder, "species.safetensors")
        record.write_bytes(found[0]["record"])
        with files.open_input_file(f"{plain}/species/{found[0]['species_hash']}.safetensors") as file:
            species.write_bytes(file.read())
        command = [demeter, "decode", str(record), "--species", str(species), "--json"]
        plant = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["plants"][0]
        # A record holds the plant in steps of its compact form, so decoding gives the stored traits again.
        assert abs(plant["traits"]["height"]["value"] - found[0]["height"]) < 1e-9, plant["traits"]["height"]
    print(f"{root}: {len(found)} plants and {organs} organs are as in the store")


def places(folder, endpoint, bucket):
    """A bucket and a folder: each its root, pyarrow's way to it, and DuckDB that can read it."""
    key, secret = os.environ["GARAGE_DEFAULT_ACCESS_KEY"], os.environ["GARAGE_DEFAULT_SECRET_KEY"]
    scheme, address = endpoint.split("://")
    region = {"region": "garage"}
    s3 = pyarrow.fs.S3FileSystem(
        access_key=key, secret_key=secret, endpoint_override=address, scheme=scheme, **region
    )
    duck = duckdb.connect()
    # DuckDB's own S3 reader is an extension that it downloads; s3fs is the same query without a download.
    duck.register_filesystem(
        s3fs.S3FileSystem(key=key, secret=secret, endpoint_url=endpoint, client_kwargs={"region_name": "garage"})
    )
    return [(f"s3://{bucket}", s3, duck), (folder, pyarrow.fs.LocalFileSystem(), duck)]


def main():
    """Both places."""
    demeter, store, *where = sys.argv[1:]
    for root, files, duck in places(*where):
        check(demeter, sqlite3.connect(store), root, files, duck)


if __name__ == "__main__":
    main()
