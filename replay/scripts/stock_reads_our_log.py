"""Reads an LCM event log with LCM's own reader (PyPI package lcm 1.5.3) and prints a summary.

Usage: python3 scripts/stock_reads_our_log.py FILE
"""

import sys
from collections import Counter

import lcm

events = list(lcm.EventLog(sys.argv[1], "r"))
assert [e.eventnum for e in events] == list(range(len(events))), "event numbers do not count up from 0"
for channel, count in sorted(Counter(e.channel for e in events).items()):
    size = sum(len(e.data) for e in events if e.channel == channel)
    print(f"{channel}: {count} events, {size} bytes")
print(f"{len(events)} events, {events[0].timestamp} us to {events[-1].timestamp} us")
