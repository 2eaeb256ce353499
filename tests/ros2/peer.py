"""A participant of another DDS implementation, Eclipse Cyclone DDS, with the types of ROS 2 written by hand.

Arguments: domain, names of the feet. Sends Twists on /cmd_vel until standard input is closed. Prints two lines of JSON: the first message of every topic,
and at the end the number of readers of /cmd_vel.
"""

import json
import sys
import threading
from dataclasses import asdict

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import array, float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


def message(name, /, **fields):
    """The class of a ROS 2 message, such as `std_msgs/Header`."""
    package, kind = name.split("/")
    return make_idl_struct(kind, f"{package}.msg.dds_.{kind}_", fields)


Time = message("builtin_interfaces/Time", sec=int32, nanosec=uint32)
Header = message("std_msgs/Header", stamp=Time, frame_id=str)
Vector3 = message("geometry_msgs/Vector3", x=float64, y=float64, z=float64)
Quaternion = message("geometry_msgs/Quaternion", x=float64, y=float64, z=float64, w=float64)
Transform = message("geometry_msgs/Transform", translation=Vector3, rotation=Quaternion)
TransformStamped = message("geometry_msgs/TransformStamped", header=Header, child_frame_id=str, transform=Transform)
TFMessage = message("tf2_msgs/TFMessage", transforms=sequence[TransformStamped])
JointState = message(
    "sensor_msgs/JointState",
    header=Header,
    name=sequence[str],
    position=sequence[float64],
    velocity=sequence[float64],
    effort=sequence[float64],
)
Imu = message(
    "sensor_msgs/Imu",
    header=Header,
    orientation=Quaternion,
    orientation_covariance=array[float64, 9],
    angular_velocity=Vector3,
    angular_velocity_covariance=array[float64, 9],
    linear_acceleration=Vector3,
    linear_acceleration_covariance=array[float64, 9],
)
Wrench = message("geometry_msgs/Wrench", force=Vector3, torque=Vector3)
WrenchStamped = message("geometry_msgs/WrenchStamped", header=Header, wrench=Wrench)
String = message("std_msgs/String", data=str)
Twist = message("geometry_msgs/Twist", linear=Vector3, angular=Vector3)


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
    print(len(twists.get_matched_subscriptions()), flush=True)


main()
