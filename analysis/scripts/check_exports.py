"""Compare the MATLAB, Parquet and CSV files of `hoof log convert` with each other and with `hoof log cat --json`.

Usage: python3 scripts/check_exports.py HOOF LOG      (needs scipy and polars; writes into a temporary folder)
"""

import json
import subprocess
import sys
import tempfile
from collections import defaultdict

import numpy
import polars
import scipy.io

HOOF, LOG = sys.argv[1:]
folder = tempfile.mkdtemp()
for to, out in [("mat", f"{folder}/log.mat"), ("parquet", f"{folder}/parquet"), ("csv", f"{folder}/csv")]:
    subprocess.run([HOOF, "log", "convert", LOG, "--to", to, "--out", out], check=True, stdout=subprocess.DEVNULL)
mat = scipy.io.loadmat(f"{folder}/log.mat")

messages = defaultdict(list)
for line in subprocess.run([HOOF, "log", "cat", "--json", LOG], check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines():
    event = json.loads(line)
    messages[event["channel"]].append(event)


def leaves(value, path=""):
    if isinstance(value, dict):
        for name, part in value.items():
            yield from leaves(part, f"{path}.{name}" if path else name)
    elif isinstance(value, list):
        for index, part in enumerate(value):
            yield from leaves(part, f"{path}[{index}]")
    else:
        yield path, value


SPECIAL = {"NaN": float("nan"), "Infinity": float("inf"), "-Infinity": float("-inf")}
compared = 0
for channel, events in messages.items():
    parquet = polars.read_parquet(f"{folder}/parquet/{channel}.parquet")
    csv = polars.read_csv(f"{folder}/csv/{channel}.csv", infer_schema_length=None)
    struct = mat[channel][0, 0]
    assert parquet.columns == csv.columns and parquet.height == csv.height == len(events), channel
    for row, event in enumerate(events):
        for path, value in leaves(event["fields"]):
            if parquet.schema[path] == polars.Float64:
                value = SPECIAL.get(value, value)
            assert parquet[path][row] == value, (channel, path, row)
            if not isinstance(value, str):
                assert csv[path][row] == value, (channel, path, row, csv[path][row], value)
            fields, place = [], [row]
            for step in path.split("."):
                name, *indices = step.replace("]", "").split("[")
                fields.append(name)
                place += [int(index) for index in indices]
            node = struct
            for name in fields[:-1]:
                node = node[name][0, 0]
            node = node[fields[-1]]
            found = node[tuple(place)] if len(place) > 1 else node[row, 0]
            if isinstance(value, str):
                found = str(found[0]) if found.size else ""
            assert found == value, (channel, path, row, found, value)
            compared += 1
            if row > 200:
                break
print(f"{compared} values of {len(messages)} channels equal in .mat, Parquet and CSV")
f = mat["CONTACT_ESTIMATE"][0, 0]["f_F_W"] if "CONTACT_ESTIMATE" in mat else None
if f is not None:
    assert f.shape == (len(messages["CONTACT_ESTIMATE"]), 4, 3) and f.dtype == numpy.float64
