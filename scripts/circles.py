#!/usr/bin/env python3
"""Import circles between the source files of each crate. Usage: see scripts/circles.sh.

A file imports another one if a `use` declaration or a path in its code (`super::x::y`, `crate::x::y`, `x::y`) names something that the other
file defines. Re-exports are followed: `use crate::Foo` imports the file that defines `Foo`, not the one with `pub use foo::Foo`. A `mod x;`
declaration is no import, nor is a `pub use` of a name that its own file does not need; code behind `#[cfg(test)]` is not counted. A circle is a strongly connected component of the graph of imports.
"""

import argparse
import json
import re
import sys
import tomllib
from pathlib import Path

TOKEN = re.compile(
    r"""
    (?P<space>\s+)
  | (?P<line_comment>//[^\n]*)
  | (?P<block_comment>/\*)
  | (?P<raw>(?:b|c)?r(?P<hashes>\#*)")
  | (?P<string>(?:b|c)?"(?:[^"\\]|\\.)*")
  | (?P<char>b?'(?:[^'\\]|\\(?:.|x[0-9a-fA-F]{2}|u\{[0-9a-fA-F_]+\}))')
  | (?P<lifetime>'[A-Za-z_]\w*)
  | (?P<ident>(?:r\#)?[^\W\d]\w*)
  | (?P<number>\d[\w]*(?:\.\d\w*)?)
  | (?P<colons>::)
  | (?P<other>.)
    """,
    re.VERBOSE | re.DOTALL,
)


def tokenize(text):
    """(token, line) pairs without comments and white space; literals become `""`."""
    tokens, at, line = [], 0, 1
    while at < len(text):
        match = TOKEN.match(text, at)
        kind, end = match.lastgroup, match.end()
        if kind == "hashes":
            kind = "raw"
        if kind == "block_comment":
            depth = 1
            while depth and end < len(text):
                if text.startswith("/*", end):
                    depth, end = depth + 1, end + 2
                elif text.startswith("*/", end):
                    depth, end = depth - 1, end + 2
                else:
                    end += 1
        elif kind == "raw":
            close = text.find('"' + match.group("hashes"), end)
            end = len(text) if close < 0 else close + 1 + len(match.group("hashes"))
        if kind in ("raw", "string", "char", "number"):
            # The literal itself is kept for `#[path = "…"]`.
            tokens.append((text[at:end] if kind == "string" else '""', line))
        elif kind == "ident":
            tokens.append((match.group("ident").removeprefix("r#"), line))
        elif kind in ("colons", "other", "lifetime"):
            tokens.append((match.group(kind), line))
        line += text.count("\n", at, end)
        at = end
    return tokens


def is_ident(token):
    return bool(re.match(r"[^\W\d]\w*$", token))


class Module:
    """A Rust module: what it defines, what it imports, and the paths that its code names."""

    def __init__(self, name, parent, file):
        self.name, self.parent, self.file = name, parent, file
        self.children, self.items = {}, set()
        self.uses = {}  # local name -> list of paths (a name may stand for a type, a value and a macro)
        self.globs = []  # (path, line)
        self.paths = []  # (path, line)
        self.idents = []  # (identifier, line): single names in code
        self.macro_calls = set()  # (name, line) of `name!`
        self.reexports = []  # (path, local name, line) of `pub use`

    def root(self):
        return self if self.parent is None else self.parent.root()


def matching(tokens, at, opening, closing):
    """The index after the bracket that closes the one at `at`."""
    depth = 0
    while at < len(tokens):
        if tokens[at][0] == opening:
            depth += 1
        elif tokens[at][0] == closing:
            depth -= 1
            if depth == 0:
                return at + 1
        at += 1
    return at


def use_tree(tokens, at, prefix, found):
    """Parses one use tree; appends (path, local name or '*', line) to `found`; returns the index after it."""
    path = list(prefix)
    while at < len(tokens):
        token, line = tokens[at]
        if token == "{":
            at += 1
            while tokens[at][0] != "}":
                at = use_tree(tokens, at, path, found)
                if tokens[at][0] == ",":
                    at += 1
            return at + 1
        if token == "*":
            found.append((path, "*", line))
            return at + 1
        if token == "::":
            at += 1
            continue
        if token == "as":
            found.append((path, tokens[at + 1][0], line))
            return at + 2
        if is_ident(token):
            if token == "self" and path:
                pass  # `x::{self}` is `x`
            else:
                path.append(token)
            at += 1
            if tokens[at][0] not in ("::", "as"):
                found.append((path, path[-1], line))
                return at
            continue
        return at + 1
    return at


def skip_item(tokens, at):
    """The index after the item that starts at `at`: past its `;` or its closing brace."""
    while at < len(tokens):
        token = tokens[at][0]
        if token == ";":
            return at + 1
        if token == "{":
            return matching(tokens, at, "{", "}")
        if token == "(":
            at = matching(tokens, at, "(", ")")
            continue
        if token == "[":
            at = matching(tokens, at, "[", "]")
            continue
        at += 1
    return at


ITEM = {"struct", "enum", "fn", "trait", "type", "const", "static", "union"}


def parse(tokens, module, directory, root):
    """Fills `module` from tokens; `directory` is where the files of its child modules are."""
    at, depth, attributes = 0, 0, []
    while at < len(tokens):
        token, line = tokens[at]
        if token == "#" and tokens[at + 1][0] in ("[", "!"):
            start = at + 1 + (tokens[at + 1][0] == "!")
            end = matching(tokens, start, "[", "]")
            attributes.append([t for t, _ in tokens[start + 1 : end - 1]])
            at = end
            if attributes[-1][:4] == ["cfg", "(", "test", ")"]:
                while tokens[at][0] == "#":
                    at = matching(tokens, at + 1, "[", "]")
                at = skip_item(tokens, at)
                attributes = []
            continue
        if token == "use":
            found, public = [], at > 0 and tokens[at - 1][0] in ("pub", ")")
            at = use_tree(tokens, at + 1, [], found)
            for path, local, use_line in found:
                if local == "*":
                    module.globs.append((path, use_line))
                else:
                    module.uses.setdefault(local, []).append(path)
                    if public:
                        module.reexports.append((path, local, use_line))
                    else:
                        module.paths.append((path, use_line))
            attributes = []
            continue
        if token == "mod" and is_ident(tokens[at + 1][0]):
            name, after = tokens[at + 1][0], tokens[at + 2][0]
            if after == "{":
                end = matching(tokens, at + 2, "{", "}")
                child = module.children[name] = Module(name, module, module.file)
                parse(tokens[at + 3 : end - 1], child, directory / name, root)
                at, attributes = end, []
                continue
            if after == ";":
                paths = [a[2].strip('"') for a in attributes if a[:2] == ["path", "="]]
                candidates = [module.file.parent / p for p in paths] or [directory / f"{name}.rs", directory / name / "mod.rs"]
                for file in candidates:
                    if file.is_file():
                        load(name, module, file, root)
                        break
                at, attributes = at + 3, []
                continue
        if token == "macro_rules" and tokens[at + 1][0] == "!":
            module.items.add(tokens[at + 2][0])
            module.root().items_of_macros[tokens[at + 2][0]] = module
            at = matching(tokens, at + 3, "{", "}")
            continue
        if depth == 0 and token in ITEM and is_ident(tokens[at + 1][0]) and tokens[at + 1][0] not in ITEM:
            module.items.add(tokens[at + 1][0])
        if token == "{":
            depth += 1
        elif token == "}":
            depth -= 1
        if is_ident(token):
            attributes = []
            if tokens[at - 1][0] != "." or at == 0:
                path = [token]
                end = at + 1
                while end + 1 < len(tokens) and tokens[end][0] == "::" and is_ident(tokens[end + 1][0]):
                    path.append(tokens[end + 1][0])
                    end += 2
                if len(path) > 1:
                    if at == 0 or tokens[at - 1][0] != "::":
                        module.paths.append((path, line))
                    at = end
                    continue
                module.idents.append((token, line))
                if at + 1 < len(tokens) and tokens[at + 1][0] == "!":
                    module.macro_calls.add((token, line))
        at += 1


def load(name, parent, file, root):
    module = Module(name, parent, file)
    if parent is None:
        module.items_of_macros = {}
        directory = file.parent
    else:
        parent.children[name] = module
        directory = file.parent if file.name == "mod.rs" else file.parent / file.stem
    parse(tokenize(file.read_text(encoding="utf-8")), module, directory, root)
    return module


def resolve(module, path, seen=frozenset()):
    """The modules (hence files) that define what `path` names, seen from `module`; empty for other crates."""
    key = (id(module), tuple(path))
    if key in seen or len(seen) > 50:
        return []
    seen = seen | {key}
    first, rest = path[0], path[1:]
    if first == "crate":
        return descend(module.root(), rest, seen)
    if first == "self":
        return descend(module, rest, seen)
    if first == "super":
        return resolve(module.parent, ["self", *rest], seen) if module.parent else []
    return descend(module, path, seen, strict=True)


def descend(module, path, seen, strict=False):
    """Follows `path` down from `module`. `strict`: a first name that the module does not know belongs to another crate."""
    if not path or path == ["*"]:
        return [module]
    first, rest = path[0], path[1:]
    if first == "super":
        return descend(module.parent, rest, seen) if module.parent else []
    if first in module.children:
        return descend(module.children[first], rest, seen)
    if first in module.items:
        return [module]
    found = []
    for target in module.uses.get(first, []):
        if target[0] != first:  # `use serde::{self}`: another crate
            found += resolve(module, target + rest, seen)
    if found or first in module.uses:
        return found
    for target, _ in module.globs:
        for origin in resolve(module, target, seen):
            if origin is not module and knows(origin, first, seen):
                found += descend(origin, path, seen)
    if found:
        return found
    return [] if strict else [module]


def knows(module, name, seen):
    if name in module.children or name in module.items or name in module.uses:
        return True
    return any(
        origin is not module and (name in origin.items or name in origin.uses)
        for target, _ in module.globs
        for origin in resolve(module, target, seen)
    )


def modules(module):
    yield module
    for child in module.children.values():
        yield from modules(child)


def imports(root):
    """{(file, imported file): (line, path)} of one target of a crate."""
    edges = {}
    for module in modules(root):
        # A single name reaches another file only through a glob import; names imported one by one count where they are imported.
        named = list(module.paths)
        used = {name for name, _ in module.idents} | {path[0] for path, _ in module.paths}
        named += [(path, line) for path, local, line in module.reexports if local in used]
        if module.globs:
            local = module.items | set(module.children) | set(module.uses)
            named += [([name], line) for name, line in module.idents if name not in local]
        # A macro without `#[macro_export]` or `use` is found by its textual scope.
        for name, line in module.idents:
            target = root.items_of_macros.get(name)
            if target is not None and (name, line) in module.macro_calls and target.file != module.file:
                edges.setdefault((module.file, target.file), (line, f"{name}!"))
        for path, line in named:
            for target in resolve(module, path):
                if target.file != module.file:
                    edges.setdefault((module.file, target.file), (line, "::".join(path)))
    return edges


def components(nodes, edges):
    """Strongly connected components (Tarjan), largest first."""
    targets = {}
    for source, target in sorted(edges):
        targets.setdefault(source, []).append(target)
    index, low, stack, on_stack, found = {}, {}, [], set(), []
    sys.setrecursionlimit(10000)

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        on_stack.add(node)
        for target in targets.get(node, []):
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in on_stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            component = []
            while True:
                top = stack.pop()
                on_stack.discard(top)
                component.append(top)
                if top == node:
                    break
            found.append(sorted(component))

    for node in sorted(nodes):
        if node not in index:
            visit(node)
    return sorted(found, key=lambda c: (-len(c), c))


def crates(top):
    """(package name, folder, root files) of each package of the workspace."""
    workspace = tomllib.loads((top / "Cargo.toml").read_text())["workspace"]["members"]
    for folder in sorted(top / member for member in workspace):
        manifest = tomllib.loads((folder / "Cargo.toml").read_text())
        roots = [folder / "src/lib.rs", folder / "src/main.rs", *sorted((folder / "src/bin").glob("*.rs"))]
        roots += [folder / b["path"] for b in manifest.get("bin", []) if "path" in b]
        unique = []
        for root in roots:
            if root.is_file() and root not in unique:
                unique.append(root)
        yield manifest["package"]["name"], folder, unique


def main():
    parser = argparse.ArgumentParser(description="Prints import circles between the source files of each crate.")
    parser.add_argument("--limit", type=int, default=3, help="files that a circle may have (default 3)")
    parser.add_argument("--edges", action="store_true", help="also print the imports inside each circle above the limit")
    parser.add_argument("--crate", dest="only", help="only this package")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    args = parser.parse_args()
    top = Path(__file__).resolve().parent.parent
    result, failed = [], False
    for name, folder, roots in crates(top):
        if args.only and name != args.only:
            continue
        edges, nodes = {}, set()
        for root in roots:
            tree = load("crate", None, root, root)
            nodes |= {m.file for m in modules(tree)}
            edges |= imports(tree)
        circles = [c for c in components(nodes, edges) if len(c) > 1]
        largest = max((len(c) for c in circles), default=1)
        failed |= largest > args.limit
        result.append({"crate": name, "files": len(nodes), "largest": largest, "circles": [[str(f.relative_to(top)) for f in c] for c in circles]})
        if args.json:
            continue
        print(f"{name}: {len(nodes)} files, largest circle {largest}" + (f" (limit {args.limit})" if largest > args.limit else ""))
        for circle in circles:
            if len(circle) <= args.limit:
                print("  " + " <-> ".join(str(f.relative_to(folder)) for f in circle))
                continue
            print(f"  circle of {len(circle)} files:")
            for file in circle:
                print(f"    {file.relative_to(folder)}")
            if args.edges:
                inside = sorted((e, at) for e, at in edges.items() if e[0] in circle and e[1] in circle)
                for (source, target), (line, path) in inside:
                    print(f"    {source.relative_to(top)}:{line}: {path} -> {target.relative_to(folder)}")
    if args.json:
        print(json.dumps(result, indent=1))
    if failed and not args.json:
        print(f"error: an import circle has more than {args.limit} files (--edges prints the imports that make it)", file=sys.stderr)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
