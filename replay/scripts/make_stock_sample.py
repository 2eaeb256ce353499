"""Writes tests/data/stock.lcmlog with LCM's own event log writer (PyPI package lcm 1.5.3).

Run from this folder's parent: python3 scripts/make_stock_sample.py
"""

import os

import lcm

PATH = "tests/data/stock.lcmlog"
if os.path.exists(PATH):
    os.remove(PATH)
log = lcm.EventLog(PATH, mode="w", overwrite=True)
log.write_event(123456789, "CH", b"hello")
log.write_event(123456999, "CH2", b"")
log.write_event(123457000, "CH", bytes(range(256)))
# A payload that contains the sync word of an event.
log.write_event(123456000, "SYNC", bytes.fromhex("eda1da01") * 8)
log.write_event(123458000, "x" * 63, b"\x00")
log.close()
