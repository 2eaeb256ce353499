"""A participant of another DDS implementation, Eclipse Cyclone DDS, with the types of ROS 2 written by hand.

Arguments: domain, names of the feet. Sends Twists on /cmd_vel, and prints the first message of every topic as JSON, in one line. Ends when standard input
is closed.
"""

import json
import sys
import threading
from dataclasses import asdict, dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Transform(IdlStruct, typename="geometry_msgs.msg.dds_.Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs.msg.dds_.TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs.msg.dds_.TFMessage_"):
    transforms: sequence[TransformStamped]


@dataclass
class JointState(IdlStruct, typename="sensor_msgs.msg.dds_.JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class Imu(IdlStruct, typename="sensor_msgs.msg.dds_.Imu_"):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class Wrench(IdlStruct, typename="geometry_msgs.msg.dds_.Wrench_"):
    force: Vector3
    torque: Vector3


@dataclass
class WrenchStamped(IdlStruct, typename="geometry_msgs.msg.dds_.WrenchStamped_"):
    header: Header
    wrench: Wrench


@dataclass
class String(IdlStruct, typename="std_msgs.msg.dds_.String_"):
    data: str


@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):
    linear: Vector3
    angular: Vector3


def main() -> None:
    domain, feet = int(sys.argv[1]), sys.argv[2:]
    participant = DomainParticipant(domain)
    # As the subscribers of ROS 2: reliable, and latched for the description of the robot.
    reliable = Policy.Reliability.Reliable(duration(seconds=1))
    qos = Qos(reliable, Policy.History.KeepLast(10))
    latched = Qos(reliable, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))
    topics = {"/joint_states": JointState, "/imu": Imu, "/tf": TFMessage, "/robot_description": String}
    topics.update({f"/contact/{foot}": WrenchStamped for foot in feet})
    readers = {
        name: DataReader(participant, Topic(participant, "rt" + name, kind), latched if kind is String else qos)
        for name, kind in topics.items()
    }
    twists = DataWriter(participant, Topic(participant, "rt/cmd_vel", Twist), qos)
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), closed.set()), daemon=True).start()
    found: dict[str, dict] = {}
    printed = False
    while not closed.is_set():
        twists.write(Twist(Vector3(0.2, -0.05, 9.0), Vector3(8.0, 7.0, 0.3)))
        for name, reader in readers.items():
            for sample in reader.take(100):
                found.setdefault(name, asdict(sample))
        if not printed and len(found) == len(readers):
            printed = True
            print(json.dumps(found), flush=True)
        closed.wait(0.02)


main()
