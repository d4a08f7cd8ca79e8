"""Reads a compacted bucket and folder with the query of docs/sync.md and with pyarrow: each plant and organ is there once.

Usage: compact_check.py FOLDER ENDPOINT BUCKET/PREFIX MERGED+DAILY STORE...: how many files of plants are to be read, and
all stores that were ever sent there.
"""

import collections
import pathlib
import sqlite3
import sys

import pyarrow.dataset

from sync_check import places


def documented():
    """The statements of docs/sync.md: what sets the root, what finds the files, the query."""
    text = pathlib.Path("docs/sync.md").read_text()
    start = text.index("    SET VARIABLE root")
    statements = text[start : text.index("\n\n", start)].split(";")
    root, files, query = [statement for statement in statements if statement.strip()]
    return root, files, query


def once(duck, columns, expected):
    """Fails unless these columns of the files are the expected rows, each once."""
    files = "read_parquet(getvariable('files'), union_by_name = true, hive_partitioning = false)"
    found = collections.Counter(duck.sql(f"SELECT {columns} FROM {files}").fetchall())
    assert found == collections.Counter(expected), (found, expected)


def check(stores, root, filesystem, duck):
    """One place; how many merged and daily files of plants were read."""
    plants, organs = [], []
    for store in stores:
        rig = "FROM plants p JOIN sessions s ON s.id = p.session"
        plants += store.execute(f"SELECT s.rig, p.id {rig}").fetchall()
        organs += store.execute(f"SELECT s.rig, p.id, o.id {rig} JOIN organs o ON o.plant = p.seq").fetchall()
    set_root, set_files, query = documented()
    duck.sql(set_root.replace("s3://BUCKET/PREFIX", root))
    # Organs first: the query itself is about plants.
    duck.sql(set_files.replace("plants", "organs"))
    once(duck, "rig, plant, id", organs)
    duck.sql(set_files)
    once(duck, "rig, id", plants)
    answer = duck.sql(query)
    print(answer)
    assert sum(row[3] for row in answer.fetchall()) == len(plants)
    files = [file.removeprefix("s3://") for file in duck.sql("SELECT getvariable('files')").fetchone()[0]]
    assert pyarrow.dataset.dataset(files, filesystem=filesystem).count_rows() == len(plants)
    merged = sum("/compacted/" in file for file in files)
    print(f"{root}: {len(plants)} plants once each, in {merged} merged and {len(files) - merged} daily files")
    return merged, len(files) - merged


def main():
    """Both places."""
    *where, expected = sys.argv[1:5]
    stores = [sqlite3.connect(store) for store in sys.argv[5:]]
    for place in places(*where):
        merged, daily = check(stores, *place)
        assert f"{merged}+{daily}" == expected, (merged, daily)


if __name__ == "__main__":
    main()
