"""Compute the metrics of a report from exported Parquet and compare them with metrics.json.

usage: hoof log convert run.mcap ticks.parquet --to ticks && hoof report run.mcap --out report
       python3 parquet_again.py ticks.parquet report/metrics.json

Needs polars and numpy, and a log with ground truth. Prints each number and that of the report, and exits with 1 if one has a relative difference above 1e-9
(1e-5 for joints, which a report stores as 32-bit floats). It is also an example of a notebook: one row per tick, one column per field, units in the file.
"""

import json
import sys

import numpy as np
import polars as pl

ticks_file, metrics_file = sys.argv[1:]
ticks = pl.scan_parquet(ticks_file).collect()
units = json.loads(pl.read_parquet_metadata(ticks_file)["units"])
with open(metrics_file) as file:
    metrics = json.load(file)
LEGS = ["LF", "RF", "LH", "RH"]
STANDS_OR_WALKS, STANCE, SWINGS = (1, 2), 0, (1, 2)
same = True


def column(name):
    return ticks[name].to_numpy()


def vector(name, n=3):
    return np.stack([column(f"{name}[{k}]") for k in range(n)], axis=1)


def compare(name, here, there, tolerance=1e-9):
    global same
    good = abs(here - there) <= tolerance * max(1.0, abs(there))
    same &= bool(good)
    print(f"{name:<34}{here:>22.12g}{there:>22.12g}{'' if good else '   DIFFERS'}")


def compare_errors(name, errors, stats, tolerance=1e-9):
    compare(f"{name} count", len(errors), stats["count"])
    compare(f"{name} mean", errors.mean(), stats["mean"], tolerance)
    compare(f"{name} std", errors.std(), stats["std"], tolerance)
    compare(f"{name} rms", np.sqrt((errors**2).mean()), stats["rms"], tolerance)
    compare(f"{name} max", abs(errors).max(), stats["max_abs"], tolerance)


print("units:", ", ".join(f"{c} [{units[c]}]" for c in ("BASE_TRACKING.rpy_des[0]", "GROUND_TRUTH.f_F_W[0][2]", "CONTROLLER_INPUT.state.tau[0]")))

# Base and swing feet: the table of tracking errors and its figures.
w, x, y, z = vector("GROUND_TRUTH.q_WB_wxyz", 4).T
rpy = np.stack(
    [np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), np.arcsin(2 * (w * y - z * x)), np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))],
    axis=1,
)
balances = np.isin(column("CONTROLLER_TICK.mode"), STANDS_OR_WALKS)
errors = (vector("BASE_TRACKING.rpy_des") - rpy + np.pi) % (2 * np.pi) - np.pi
for k, name in enumerate(["roll", "pitch", "yaw"]):
    compare_errors(name, errors[balances, k], metrics["tracking"][name])
p_WB = vector("GROUND_TRUTH.p_WB")
p_WF = np.stack([vector(f"GROUND_TRUTH.p_WF[{leg}]") for leg in range(4)], axis=1)
state = vector("LEG_STATE.state", 4)
stance = state == STANCE
standing = balances & stance.any(axis=1)
ground = (p_WF[:, :, 2] * stance).sum(axis=1) / np.maximum(stance.sum(axis=1), 1)
compare_errors("height", (column("BASE_TRACKING.height_des") - (p_WB[:, 2] - ground))[standing], metrics["tracking"]["height"])
c, s = np.cos(rpy[:, 2]), np.sin(rpy[:, 2])
for leg, name in enumerate(LEGS):
    d = p_WF[:, leg] - p_WB
    p_H = np.stack([c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1], d[:, 2]], axis=1)
    swings = balances & np.isin(state[:, leg], SWINGS)
    foot_errors = vector(f"LEG_STATE.p_BF_H_des[{leg}]") - p_H
    for k, axis in enumerate("xyz"):
        compare_errors(f"{name} {axis}", foot_errors[swings, k], metrics["tracking"]["feet"][leg][axis])

# Contact: the confusion matrix and the travel of feet on the ground.
period_s = metrics["run"]["period_s"]
for leg, name in enumerate(LEGS):
    true, found = column(f"GROUND_TRUTH.contact[{leg}]"), column(f"CONTACT_ESTIMATE.contact[{leg}]")
    of_leg = metrics["contact"]["legs"][leg]
    compare(f"{name} missed ticks", int((true & ~found).sum()), of_leg["true_missed"])
    compare(f"{name} false ticks", int((~true & found).sum()), of_leg["none_found"])
    speed = np.hypot(column(f"GROUND_TRUTH.v_WF[{leg}][0]"), column(f"GROUND_TRUTH.v_WF[{leg}][1]"))
    compare(f"{name} slip [m]", speed[true].sum() * period_s, metrics["slip"][leg]["travel_m"])

# Joints and power.
joints = metrics["energy"]["joints"]
n = len(joints)
power = vector("CONTROLLER_INPUT.state.tau", n) * vector("CONTROLLER_INPUT.state.qd", n)
compare("mean power [W]", power.sum(axis=1).mean(), metrics["energy"]["mean_power_w"], 1e-5)
compare("positive work [J]", np.maximum(power, 0).sum() * period_s, metrics["energy"]["positive_work_j"], 1e-5)
for k, joint in enumerate(joints):
    difference = column(f"ROBOT_COMMAND.q_des[{k}]") - column(f"CONTROLLER_INPUT.state.q[{k}]")
    compare(f"{joint['joint']} rms", np.sqrt((difference**2).mean()), joint["position"]["rms"], 1e-5)

# Durations: quantiles by nearest rank.
took_us = np.sort(column("TIMING.end_ns") - column("TIMING.start_ns")) / 1e3
for key, share in [("p50", 0.5), ("p99", 0.99), ("p999", 0.999)]:
    compare(f"tick {key} [µs]", took_us[int(np.ceil(share * len(took_us))) - 1], metrics["timing"]["tick_us"][key])
compare("tick max [µs]", took_us[-1], metrics["timing"]["tick_us"]["max"])
sys.exit(0 if same else 1)
