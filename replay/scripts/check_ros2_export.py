"""Checks an export of `hoof log convert --to mcap --encoding ros2`: decodes it with PyPI's mcap and mcap-ros2-support, and compares every
field of every message with the source log, read with `hoof log cat --json`.

Usage: python3 scripts/check_ros2_export.py HOOF LOG EXPORTED

Checked: every channel has the same number of messages on its topic, at the same times, with equal values in every field (floats bit for
bit); /tf is one tree from `world` over every link of the URDF in /robot_description, with unit quaternions, and its base follows
GROUND_TRUTH; foot positions from /tf agree with GROUND_TRUTH; /joint_states equals ROBOT_STATE.
"""

import json
import math
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections import defaultdict

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

HOOF, LOG, EXPORTED = sys.argv[1:]


def flat(value):
    """Leaf values in wire order, independent of names and dimensions."""
    if isinstance(value, dict):
        for part in value.values():
            yield from flat(part)
    elif isinstance(value, (list, tuple)):
        for part in value:
            yield from flat(part)
    elif isinstance(value, (bytes, bytearray)):
        yield from value
    elif hasattr(value, "__slots__"):
        for name in value.__slots__:
            yield from flat(getattr(value, name))
    elif type(value).__module__.startswith("array") or hasattr(value, "tolist"):
        yield from value.tolist()
    else:
        yield value


def same(a, b):
    special = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
    a = special.get(a, a) if isinstance(b, float) else a
    return a == b or (isinstance(a, float) and math.isnan(a) and math.isnan(b))


topics = defaultdict(list)
with open(EXPORTED, "rb") as file:
    for _, channel, message, decoded in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(log_time_order=False):
        topics[channel.topic].append((message.log_time, decoded))

counts = defaultdict(int)
truth, robot_state = [], []
cat = subprocess.Popen([HOOF, "log", "cat", "--json", LOG], stdout=subprocess.PIPE, text=True)
for line in cat.stdout:
    event = json.loads(line)
    topic = "/" + event["channel"]
    place = counts[topic]
    counts[topic] += 1
    time, decoded = topics[topic][place]
    assert time == event["t_ns"], (topic, place, time, event["t_ns"])
    expected, found = list(flat(event["fields"])), list(flat(decoded))
    assert len(expected) == len(found), (topic, place, len(expected), len(found))
    for i, (a, b) in enumerate(zip(expected, found)):
        assert same(a, b), (topic, place, i, a, b)
    if topic == "/GROUND_TRUTH":
        truth.append(event["fields"])
    if topic == "/ROBOT_STATE":
        robot_state.append(event["fields"])
assert cat.wait() == 0
for topic, count in counts.items():
    assert len(topics[topic]) == count, topic
print(f"{sum(counts.values())} messages on {len(counts)} topics equal in every field")

[(_, description)] = topics["/robot_description"]
urdf = ElementTree.fromstring(description.data)
links = {link.get("name") for link in urdf.findall("link")}
parents = {j.find("child").get("link"): j.find("parent").get("link") for j in urdf.findall("joint")}


def rotate(q, v):
    x, y, z, w = q
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return [v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx]


def world_of(link, transforms):
    p = [0.0, 0.0, 0.0]
    while link != "world":
        parent, t = transforms[link]
        q = (t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w)
        assert abs(math.hypot(*q) - 1) < 1e-9, link
        p = [a + b for a, b in zip(rotate(q, p), (t.translation.x, t.translation.y, t.translation.z))]
        link = parent
    return p


by_time = {fields["t_ns"]: fields for fields in truth}
feet = [topic.rsplit("/", 1)[1] for topic in sorted(topics) if topic.startswith("/contact_truth/")]
worst = 0.0
for time, message in topics["/tf"]:
    transforms = {t.child_frame_id: (t.header.frame_id, t.transform) for t in message.transforms}
    assert set(transforms) == links, links ^ set(transforms)
    assert all(parent == parents.get(child, "world") for child, (parent, _) in transforms.items())
    fields = by_time[time]
    [root] = links - set(parents)
    assert world_of(root, transforms) == fields["p_WB"]
    positions = [world_of(foot, transforms) for foot in feet]
    # GROUND_TRUTH has the lowest point of each foot's sphere, /tf its centre.
    for p in fields["p_WF"]:
        worst = max(worst, min(math.dist(p[:2], q[:2]) for q in positions))
print(f"{len(topics['/tf'])} transforms of {len(links)} links; feet within {worst:.2e} m of the truth (horizontally)")
# The simulator uses its own contact frame; a wrong link or joint would be off by centimetres.
assert worst < 1e-5, worst

assert len(topics["/joint_states"]) == len(robot_state)
names = [j.get("name") for j in urdf.findall("joint") if j.get("type") != "fixed"]
for (_, message), fields in zip(topics["/joint_states"], robot_state):
    assert list(message.name) == names
    assert [list(v) for v in (message.position, message.velocity, message.effort)] == [fields["q"], fields["qd"], fields["tau"]]
print(f"{len(robot_state)} joint states equal")
for topic in sorted(topics):
    print(f"  {topic}: {len(topics[topic])}")
