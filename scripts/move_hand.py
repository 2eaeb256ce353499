#!/usr/bin/env python3
"""Moves a hand of COMAN through three way-points, as a program outside of hoofprint does it.

    pip install lcm
    lcm-gen -p --ppath /tmp/types lcmtypes/*.lcm
    hoof run runs/coman_hands.toml                      # in another terminal
    PYTHONPATH=/tmp/types python3 scripts/move_hand.py
"""

import random
import time

import lcm
from hoofprint import task_reply_t, task_request_t, task_waypoint_t


def waypoint(t, x, y, z):
    point = task_waypoint_t()
    point.time, point.position, point.q_wxyz = t, [x, y, z], [1.0, 0.0, 0.0, 0.0]
    return point


def main():
    bus = lcm.LCM("udpm://239.255.76.67:7667?ttl=0")
    request = task_request_t()
    request.t_ns, request.sender_id, request.request_id = time.monotonic_ns(), random.getrandbits(62), 1
    request.task, request.operation, request.relative = "left_hand", task_request_t.WAYPOINTS, True
    request.poses = [waypoint(1.5, 0.0, 0.05, 0.1), waypoint(3.0, 0.05, 0.0, 0.1), waypoint(4.5, 0.0, 0.0, 0.0)]
    request.n = len(request.poses)
    answers = []
    bus.subscribe("(.*/)?TASK_REPLY", lambda _, data: answers.extend(task_reply_t.decode(data).answers))
    bus.publish("TASK_REQUEST", request.encode())
    bus.handle_timeout(2000)
    print([(answer.code, answer.reason) for answer in answers if answer.sender_id == request.sender_id])


main()
