#!/usr/bin/env python3
"""Captures the datagrams that LCM sends, for replay/tests/udpm.rs.

    capture_lcm_datagrams.py > replay/tests/data/lcm_datagrams.json

Needs a multicast route, PyPI's lcm 1.5.3 in this Python, and Debian's liblcm-dev 1.3.1 with a C compiler. Byte i of a payload is i % 251,
so that the file contains only the first bytes, the length and the CRC of each datagram.
"""
import json
import pathlib
import socket
import struct
import subprocess
import tempfile
import zlib

import lcm

GROUP, PORT = "239.255.76.67", 17999
URL = f"udpm://{GROUP}:{PORT}?ttl=0"
# Short; longest short; two fragments (shortest, longest); three; many; longest channel name.
MESSAGES = [("CH", 5), ("CH", 65_496), ("CH", 65_497), ("CH", 130_971), ("CH", 130_972), ("C" * 63, 200_000), ("CH", 1_000_000)]

C_SENDER = r"""
#include <lcm/lcm.h>
#include <stdlib.h>
#include <string.h>
int main(int argc, char **argv) {
    lcm_t *lcm = lcm_create(argv[1]);
    for (int i = 2; i + 1 < argc; i += 2) {
        int n = atoi(argv[i + 1]);
        unsigned char *data = malloc(n);
        for (int k = 0; k < n; k++) data[k] = k % 251;
        if (lcm_publish(lcm, argv[i], data, n)) return 1;
        free(data);
    }
    lcm_destroy(lcm);
    return 0;
}
"""


def payload(n):
    return bytes(i % 251 for i in range(n))


def listen():
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
    s.bind((GROUP, PORT))
    s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, struct.pack("4s4s", socket.inet_aton(GROUP), bytes(4)))
    s.settimeout(1.0)
    return s


def capture(version, send):
    """Captures the datagrams that `send` sends, one entry per message."""
    s = listen()
    send()
    by_sequence = {}
    try:
        while True:
            d = s.recv(70_000)
            by_sequence.setdefault(struct.unpack(">I", d[4:8])[0], []).append(d)
    except socket.timeout:
        pass
    s.close()
    entries = []
    for (sequence, datagrams), (channel, n) in zip(sorted(by_sequence.items()), MESSAGES, strict=True):
        heads = [{"head": d[:48].hex(), "length": len(d), "crc32": zlib.crc32(d)} for d in datagrams]
        entries.append({"lcm": version, "sequence": sequence, "channel": channel, "payload": n, "datagrams": heads})
    return entries


def send_1_5_3():
    bus = lcm.LCM(URL)
    for channel, n in MESSAGES:
        bus.publish(channel, payload(n))


def send_1_3_1():
    with tempfile.TemporaryDirectory() as folder:
        source, program = pathlib.Path(folder, "send.c"), pathlib.Path(folder, "send")
        source.write_text(C_SENDER)
        subprocess.run(["cc", "-o", program, source, "-llcm"], check=True)
        subprocess.run([program, URL, *[str(x) for m in MESSAGES for x in m]], check=True)


def main():
    entries = capture("1.3.1", send_1_3_1) + capture("1.5.3", send_1_5_3)
    lines = ",\n".join(json.dumps(e) for e in entries)
    print(f"[\n{lines}\n]")


if __name__ == "__main__":
    main()
