"""Decodes and encodes messages with the code that stock lcm-gen generates. Input: lines of type name and message in hexadecimal. Output: the same."""
import importlib
import sys

for line in sys.stdin:
    name, data = line.split()
    message = getattr(importlib.import_module("hoofprint." + name), name).decode(bytes.fromhex(data))
    print(name, message.encode().hex())
