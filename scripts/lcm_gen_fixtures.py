#!/usr/bin/env python3
"""Writes the expected fingerprints and bytes of the conformance types, computed by the stock LCM tools.

    python3 scripts/lcm_gen_fixtures.py            writes lcmtypes/idl/tests/conformance/expected.json
    python3 scripts/lcm_gen_fixtures.py --check    only compares; exit code 1 if anything differs

Needs the PyPI package `lcm` 1.5.3 in the Python that runs it (lcm-gen, Python code) and Debian's liblcm-dev and liblcm-bin
1.3.1 with gcc (lcm-gen in /usr/bin, C code). The bytes are from the Python code; the C code must decode them and encode the same
bytes. Both compute the fingerprints.
"""

import importlib
import json
import math
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent.parent / "lcmtypes/idl/tests/conformance"
OUT = HERE / "expected.json"
TYPES = sorted(HERE.glob("*.lcm"))
# lcm-gen 1.3.1 does not support constants as dimensions; C does not support structs that contain each other.
NOT_IN_C = {"named_constants.lcm": {"conformance.named_constants_t"}, "mutual.lcm": {"conformance.ping_t", "conformance.pong_t"}}
# The C decoder of an array of enums advances by one element only.
NOT_DECODED_BY_C = {"conformance.enums_t"}
LCM_GEN_1_3 = "/usr/bin/lcm-gen"

POINT = {"x": 1.5, "y": -0.0}
LEAF = {"name": "leaf", "num_children": 0, "children": []}
PRIMITIVES = dict(i8=-128, i16=-2, i32=2**31 - 1, i64=-(2**63), b=255, f=0.1, d=-1e-310, s="größe\n", yes=True)
MESSAGES = [
    ("conformance.primitives_t", PRIMITIVES),
    ("conformance.primitives_t", dict(i8=0, i16=0, i32=0, i64=0, b=0, f=math.inf, d=math.nan, s="", yes=False)),
    ("conformance.empty_t", {}),
    (
        "conformance.arrays_t",
        dict(
            n8=2, n16=1, n32=3, n64=4, fixed=[1.0, 2.0, 3.0], matrix=[[1, 2, 3], [4, 5, 6]], by_n8=[-1, 300], by_n16=[True],
            by_n32=["", "b", "ccc"], by_n64=b"\x00\x01\xfe\xff", rows=[[1, 2, 3], [4, 5, 6], [7, 8, 9]],
            columns=[[0.5, 0.25], [-0.5, -0.25]], square=[[70000], [-70000]], cube=[[[1, 2, 3], [4, 5, 6]], [[7, 8, 9], [-1, -2, -3]]],
            hexadecimal=[[1, 2], [3, 4], [5, 2**40]], names=["one", "two"], raw=b"\xde\xad\xbe\xef",
        ),
    ),
    (
        "conformance.arrays_t",
        dict(
            n8=0, n16=0, n32=0, n64=0, fixed=[0, 0, 0], matrix=[[0, 0, 0], [0, 0, 0]], by_n8=[], by_n16=[], by_n32=[], by_n64=b"",
            rows=[], columns=[[], []], square=[], cube=[], hexadecimal=[[], [], []], names=["", ""], raw=b"\0\0\0\0",
        ),
    ),
    ("conformance.one_line_t", dict(a=1, b=[2, 3], c=[4], d="d", e="e")),
    ("conformance.long_t", dict(x=list(range(40)), y=[[100 * i + j + 0.5 for j in range(34)] for i in range(33)])),
    (
        "conformance.nested_t",
        dict(
            n=2, p=POINT, q=[POINT, {"x": 1e308, "y": 5e-324}], r=[{"x": 1, "y": 2, "exact": POINT}] * 2, nothing=[{}] * 3,
            colour=-3,
        ),
    ),
    ("conformance.enums_t", dict(n=2, palette=[1, 99], other=[16, 17])),
    ("conformance.node_t", dict(name="root", num_children=2, children=[LEAF, dict(name="inner", num_children=1, children=[LEAF])])),
    (
        "conformance.ping_t",
        dict(n=1, pongs=[dict(n=1, pings=[dict(n=0, pongs=[], where=POINT)], node=LEAF)], where={"x": 7, "y": 8}),
    ),
    ("conformance.commented_t", dict(num_x=1, x=[2.5], type=1, match=2, self=3, box=4)),
    ("conformance.named_constants_t", dict(matrix=[[1, 2, 3], [4, 5, 6]], n=1, mixed=[[1], [2]])),
    ("bare_t", dict(t=1, more=[dict(t=0, more=[])])),
    (
        "exlcm.example_t",
        dict(
            timestamp=1234567890123456, position=[1, 2, 3], orientation=[1, 0, 0, 0], num_ranges=3, ranges=[0, -1, 2],
            name="example string", enabled=True,
        ),
    ),
    ("exlcm.muldim_array_t", dict(size_a=1, size_b=2, size_c=2, data=[[[1, 2], [3, 4]]], strarray=[["a", "b"], ["c", "d"]])),
    (
        "lcmtest.bools_t",
        dict(one_bool=True, fixed_array=[True, False, True], num_a=2, num_b=1, one_dim_array=[False, True], two_dim_array=[[True], [False]]),
    ),
]


def main():
    lcm_gen = shutil.which("lcm-gen", path=str(pathlib.Path(sys.executable).parent)) or shutil.which("lcm-gen")
    expected = {"made_by": [version(lcm_gen), version(LCM_GEN_1_3)], "types": {}, "enums": {}, "messages": []}
    with tempfile.TemporaryDirectory() as folder:
        # One file per call: lcm-gen applies the package of a file to the next one.
        for path in TYPES:
            run(lcm_gen, "--python", "--ppath", folder, path)
        sys.path.insert(0, folder)
        base = base_hashes(lcm_gen)
        for name in sorted(base):
            kind, value = base[name]
            full = python_class(name)._get_hash_recursive([]) & (2**64 - 1)
            if kind == "enum":
                expected["enums"][name] = f"{full:016x}"
            else:
                expected["types"][name] = {"base": value, "full": f"{full:016x}"}
        for name, fields in MESSAGES:
            message = build(name, fields)
            expected["messages"].append({"type": name, "hex": message.encode().hex(), "leaves": [" ".join(leaf) for leaf in leaves(message, "")]})
        check_with_c(pathlib.Path(folder), expected)

    text = json.dumps(expected, indent=1, ensure_ascii=False) + "\n"
    if "--check" not in sys.argv[1:]:
        OUT.write_text(text)
    elif OUT.read_text() != text:
        sys.exit(f"{OUT} differs from the output of {' and '.join(expected['made_by'])}")


def version(lcm_gen):
    return run(lcm_gen, "--version").strip()


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"exit code {done.returncode} from {' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def base_hashes(lcm_gen):
    """Kind and base hash of every type, as `lcm-gen -d` prints them."""
    found = {}
    for line in "".join(run(lcm_gen, "-d", path) for path in TYPES).splitlines():
        words = line.split()
        if line.startswith("enum "):
            found[words[1]] = ("enum", None)
        elif line.startswith("struct "):
            value = line.split("0x")[1].rstrip("]")
            found[words[1]] = ("struct", f"{int(value, 16):016x}")
    return found


def python_class(name):
    """The generated class; a type without a package is in a module of the same name."""
    package, _, short = name.rpartition(".")
    module = importlib.import_module(package or short)
    found = getattr(module, short)
    return getattr(found, short) if not isinstance(found, type) else found


PRIMITIVE_NAMES = {"int8_t", "int16_t", "int32_t", "int64_t", "byte", "float", "double", "string", "boolean"}


def build(name, fields):
    """A message, built without its constructor, which fails on enums."""
    cls = python_class(name)
    if not hasattr(cls, "__typenames__"):
        return cls(fields)
    assert list(fields) == cls.__slots__, (name, list(fields), cls.__slots__)
    message = cls.__new__(cls)
    for field, ty in zip(cls.__slots__, cls.__typenames__):
        setattr(message, field, fields[field] if ty in PRIMITIVE_NAMES else build_nested(ty, fields[field]))
    return message


def build_nested(ty, value):
    return [build_nested(ty, v) for v in value] if isinstance(value, list) else build(ty, value)


def leaves(message, prefix):
    """Path, type and value of every leaf in wire order; floats as the hexadecimal number of their bits."""
    for field, ty in zip(message.__slots__, message.__typenames__):
        yield from leaves_of(getattr(message, field), ty, f"{prefix}{field}")


def leaves_of(value, ty, path):
    if isinstance(value, (list, tuple, bytes)):
        for index, item in enumerate(value):
            yield from leaves_of(item, ty, f"{path}[{index}]")
    elif ty not in PRIMITIVE_NAMES and hasattr(value, "__typenames__"):
        yield from leaves(value, path + ".")
    elif ty not in PRIMITIVE_NAMES:
        yield [path, "int32_t", str(value.value)]
    elif ty == "double":
        yield [path, ty, struct.pack(">d", value).hex()]
    elif ty == "float":
        yield [path, ty, struct.pack(">f", value).hex()]
    elif ty == "boolean":
        yield [path, ty, "true" if value else "false"]
    else:
        yield [path, ty, str(value)]


C_MAIN = """
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
%(includes)s

#define TYPE(c_name, name) \\
    if (!strcmp(argv[1], name)) { \\
        c_name message; \\
        if (argc == 2) { printf("%%016llx", (unsigned long long) __##c_name##_get_hash()); return 0; } \\
        size_t size = strlen(argv[2]) / 2; \\
        unsigned char *in = malloc(size + 1), *out = malloc(size + 1); \\
        for (size_t i = 0; i < size; i++) sscanf(argv[2] + 2 * i, "%%2hhx", in + i); \\
        if (c_name##_decode(in, 0, size, &message) != (int) size) return 1; \\
        if (c_name##_encode(out, 0, size, &message) != (int) size) return 2; \\
        return memcmp(in, out, size) ? 3 : 0; \\
    }

int main(int argc, char **argv)
{
%(types)s
    return 4;
}
"""


def check_with_c(folder, expected):
    """Compares fingerprints and bytes with the C code of lcm-gen 1.3.1."""
    for path in TYPES:
        if path.name not in NOT_IN_C:
            run(LCM_GEN_1_3, "-c", "--c-cpath", folder, "--c-hpath", folder, path)
    names = [name for name in expected["types"] if name not in set().union(*NOT_IN_C.values())]
    c_names = {name: name.replace(".", "_") for name in names}
    main_c = folder / "main.c"
    main_c.write_text(
        C_MAIN
        % {
            "includes": "\n".join(f'#include "{c}.h"' for c in c_names.values()),
            "types": "\n".join(f'    TYPE({c}, "{name}")' for name, c in c_names.items()),
        }
    )
    program = folder / "main"
    run("gcc", "-w", "-I", folder, "-o", program, main_c, *folder.glob("*_t.c"), "-llcm")
    for name in names:
        full = run(program, name)
        assert full == expected["types"][name]["full"], f"{name}: C {full}, Python {expected['types'][name]['full']}"
    for message in expected["messages"]:
        if message["type"] in c_names and message["type"] not in NOT_DECODED_BY_C:
            run(program, message["type"], message["hex"])


if __name__ == "__main__":
    main()
