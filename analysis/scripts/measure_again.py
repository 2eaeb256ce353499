"""Measure a log a second time, by another route, and hold metrics.json against it.

usage: measure_again.py LOG.mcap METRICS.json TYPES_DIR

Decoding is by stock lcm-gen (`lcm-gen -p --ppath TYPES_DIR lcmtypes/*.lcm`), reading by the mcap package, arithmetic by numpy. Needs a log with
ground truth. Prints each quantity and exits with 1 if any differs by more than 1e-9.
"""

import json
import sys

import numpy as np
from mcap.reader import make_reader

log, metrics_file, types_dir = sys.argv[1:]
sys.path.insert(0, types_dir)
import hoofprint as types  # noqa: E402

CHANNELS = {
    "BASE_TRACKING": types.base_tracking_t,
    "GROUND_TRUTH": types.ground_truth_t,
    "LEG_STATE": types.leg_state_t,
    "CONTACT_ESTIMATE": types.contact_estimate_t,
    "CONTROLLER_TICK": types.controller_tick_t,
    "TIMING": types.timing_t,
}
LEGS = ["LF", "RF", "LH", "RH"]
STANDS, WALKS = types.controller_tick_t.MODE_STANCE, types.controller_tick_t.MODE_WALK
STANCE = types.leg_state_t.STATE_STANCE
SWINGS = (types.leg_state_t.STATE_SWING_UP, types.leg_state_t.STATE_SWING_DOWN)


def rotation(w, x, y, z):
    """Matrix of a unit quaternion, column by column the images of the axes."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


messages = {channel: {} for channel in CHANNELS}
with open(log, "rb") as file:
    for _, channel, message in make_reader(file).iter_messages(topics=list(CHANNELS)):
        decoded = CHANNELS[channel.topic].decode(message.data)
        messages[channel.topic][decoded.t_ns] = decoded

errors = {name: [] for name in ["roll", "pitch", "yaw", "height"] + [f"{leg} {axis}" for leg in LEGS for axis in "xyz"]}
agreement = np.zeros((4, 2, 2), dtype=int)
for t_ns, base in messages["BASE_TRACKING"].items():
    truth, legs = messages["GROUND_TRUTH"].get(t_ns), messages["LEG_STATE"].get(t_ns)
    if truth is None or legs is None:
        continue
    for leg in range(4):
        # int: numpy takes a bool for a mask
        agreement[leg, int(truth.contact[leg]), int(messages["CONTACT_ESTIMATE"][t_ns].contact[leg])] += 1
    if messages["CONTROLLER_TICK"][t_ns].mode not in (STANDS, WALKS):
        continue
    r = rotation(*truth.q_WB_wxyz)
    rpy = np.array([np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])])
    rpy_error = (np.array(base.rpy_des) - rpy + np.pi) % (2 * np.pi) - np.pi
    for name, error in zip(["roll", "pitch", "yaw"], rpy_error):
        errors[name].append(error)
    feet = np.array(truth.p_WF)
    stance = [leg for leg in range(4) if legs.state[leg] == STANCE]
    if stance:
        errors["height"].append(base.height_des - (truth.p_WB[2] - feet[stance, 2].mean()))
    heading = np.array([np.cos(rpy[2]), np.sin(rpy[2]), 0.0])
    axes_of_h = np.array([heading, [-heading[1], heading[0], 0.0], [0.0, 0.0, 1.0]])
    for leg in range(4):
        if legs.state[leg] in SWINGS:
            error = np.array(legs.p_BF_H_des[leg]) - axes_of_h @ (feet[leg] - np.array(truth.p_WB))
            for axis, value in zip("xyz", error):
                errors[f"{LEGS[leg]} {axis}"].append(value)

with open(metrics_file) as file:
    metrics = json.load(file)
same = True


def compare(name, here, there):
    global same
    good = abs(here - there) <= 1e-9
    same &= good
    print(f"{name:<24}{here:>20.12g}{there:>20.12g}{'' if good else '   DIFFERS'}")


for name, values in errors.items():
    stats = metrics["tracking"].get(name) or next(f for f in metrics["tracking"]["feet"] if f["leg"] == name[:2])[name[3:]]
    e = np.array(values)
    compare(f"{name} count", len(e), stats["count"])
    for key, value in [("mean", e.mean()), ("std", e.std()), ("rms", np.sqrt((e**2).mean())), ("mean_abs", abs(e).mean()), ("max_abs", abs(e).max())]:
        compare(f"{name} {key}", value, stats[key])
for leg, found in zip(metrics["contact"]["legs"], agreement):
    for (touches, flag), key in [((0, 0), "none_none"), ((0, 1), "none_found"), ((1, 0), "true_missed"), ((1, 1), "true_found")]:
        compare(f"{leg['leg']} {key}", found[touches, flag], leg[key])
durations = np.sort([(t.end_ns - t.start_ns) / 1e3 for t in messages["TIMING"].values()])
for key, value in [("mean", durations.mean()), ("p50", durations[(len(durations) + 1) // 2 - 1]), ("max", durations[-1])]:
    compare(f"tick {key} [us]", value, metrics["timing"]["tick_us"][key])
sys.exit(0 if same else 1)
