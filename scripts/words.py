#!/usr/bin/env python3
"""Finds old names and phrases of scripts/words.tsv in the files of the repository. Usage: see scripts/words.sh."""

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

KINDS = (".rs", ".md", ".toml", ".sh", ".py", ".lcm", ".css", ".html", "Makefile", "SOURCES")
LIST = "scripts/words.tsv"
# Names on the wire, in JSON and in files that tools write: users type or read them, so they stay.
EXEMPT = re.compile(
    r"""happenings\.json|"happenings"|"wishes_not_taken"|["']heard["']|bytes and heard,|["`]mend["`]|stand\.patience|"patience"|MovePhase::Rise|^ +Rise,$"""
)


def patterns(text):
    for number, line in enumerate(text.splitlines(), 1):
        if not line or line.startswith("#"):
            continue
        pattern, tab, instead = line.partition("\t")
        if not tab:
            sys.exit(f"error: {LIST}:{number}: expected a pattern, a tab and a replacement, found {line!r}")
        # A space between words is `_` in an identifier.
        pattern = pattern.replace(" ", "[ _]")
        yield pattern, instead


def at_letter_edges(pattern):
    return re.compile(f"(?<![A-Za-z])(?:{pattern})(?![A-Za-z])", re.IGNORECASE)


COMMENT = re.compile(r"^\s*(?:///?|//!|#|\*)(?!\[)\s*")
WORDS_OF_A_PHRASE = 5
HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def searched(text):
    """(line, text, joint) triples: each line, the words of each CamelCase name joined by `_`, and the text around each line end.

    `joint`: only a match across this position counts, -1 = any match.
    """
    lines = [EXEMPT.sub("", line) for line in text.splitlines()]
    for number, line in enumerate(lines, 1):
        yield number, line, -1
        for name in re.findall(r"[A-Za-z0-9]*[a-z0-9][A-Z][A-Za-z0-9]*", line):
            yield number, HUMP.sub("_", name), -1
    for number, (line, after) in enumerate(zip(lines, lines[1:]), 1):
        first = " ".join(line.split()[-WORDS_OF_A_PHRASE:])
        second = " ".join(COMMENT.sub("", after).split()[:WORDS_OF_A_PHRASE])
        if first and second:
            yield number, f"{first} {second}", len(first)


def main():
    parser = argparse.ArgumentParser(description="Finds old names and phrases in the files of the repository.")
    parser.add_argument("paths", nargs="*", help="only files whose path starts with one of these")
    parser.add_argument("--json", action="store_true", help="print the number of hits as JSON")
    parser.add_argument("--count", action="store_true", help="print hits per folder and per pattern only")
    args = parser.parse_args()
    top = Path(__file__).resolve().parent.parent
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=top, check=True, capture_output=True).stdout.decode()
    files = [f for f in listed.split("\0") if f.endswith(KINDS) and (top / f).is_file()]
    files = [f for f in files if f != "scripts/words.py"]
    files = [f for f in files if not args.paths or f.startswith(tuple(args.paths))]
    listed_patterns = list(patterns((top / LIST).read_text(encoding="utf-8")))
    any_of = at_letter_edges("|".join(pattern for pattern, _ in listed_patterns))
    old = [(at_letter_edges(pattern), instead) for pattern, instead in listed_patterns]
    hits, seen = [], set()
    for file in files:
        for number, line, joint in searched((top / file).read_text(encoding="utf-8")):
            if not any_of.search(line):
                continue
            for pattern, instead in old:
                match = next((m for m in pattern.finditer(line) if joint < 0 or m.start() < joint < m.end()), None)
                if match and (file, number, instead) not in seen:
                    seen.add((file, number, instead))
                    hits.append((file, number, match.group(), instead))
    if args.json:
        print(json.dumps({"hits": len(hits), "files": len({h[0] for h in hits})}))
    elif args.count:
        for key in (lambda h: h[0].split("/")[0], lambda h: h[3]):
            counts = {}
            for hit in hits:
                counts[key(hit)] = counts.get(key(hit), 0) + 1
            for name, count in sorted(counts.items(), key=lambda c: -c[1]):
                print(f"{count:6} {name}")
            print()
    else:
        for file, number, found, instead in hits:
            print(f"{file}:{number}: `{found}`: write: {instead}")
    if hits and not args.json:
        print(f"error: {len(hits)} old names or phrases in {len({h[0] for h in hits})} files", file=sys.stderr)
    sys.exit(1 if hits else 0)


if __name__ == "__main__":
    main()
