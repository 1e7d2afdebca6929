"""ROS 2 messages as the CDR bytes that ROS 2 itself sends, without ROS; needs only pycdr2.

Every class knows its name in ROS and its type hash (REP 2016), which `rmw_zenoh` puts into its keys.
"""

from dataclasses import dataclass

from pycdr2 import IdlStruct
from pycdr2.types import float32, float64, int32, sequence, uint8, uint32

FRAME_ID = "world"
"""Frame of all poses: the Tracker's world."""


@dataclass
class Time(IdlStruct):
    sec: int32
    nanosec: uint32

    @classmethod
    def at(cls, seconds: float) -> "Time":
        """Seconds since 1970."""
        nanoseconds = round(seconds * 1e9)
        return cls(nanoseconds // 1_000_000_000, nanoseconds % 1_000_000_000)


@dataclass
class Header(IdlStruct):
    stamp: Time
    frame_id: str


@dataclass
class Point(IdlStruct):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct):
    ROS_NAME = "geometry_msgs/msg/PoseStamped"
    ROS_HASH = "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"
    header: Header
    pose: Pose


@dataclass
class Path(IdlStruct):
    ROS_NAME = "nav_msgs/msg/Path"
    ROS_HASH = "RIHS01_1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b"
    header: Header
    poses: sequence[PoseStamped]


@dataclass
class Joy(IdlStruct):
    ROS_NAME = "sensor_msgs/msg/Joy"
    ROS_HASH = "RIHS01_0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5"
    header: Header
    axes: sequence[float32]
    buttons: sequence[int32]


@dataclass
class Takeoff(IdlStruct):
    """Request of a service of Crazyswarm2; `duration` has the fields of a time."""

    ROS_NAME = "crazyflie_interfaces/srv/Takeoff"
    ROS_HASH = "RIHS01_c993cbf6ab9f668c9b3f85bf401956a80de5db48243ceedd5e25fdda027cb714"
    group_mask: uint8
    height: float32
    duration: Time


@dataclass
class Land(IdlStruct):
    ROS_NAME = "crazyflie_interfaces/srv/Land"
    ROS_HASH = "RIHS01_4e9791ea19b8d15570029738e86cccc3825f87b6e60854be62d8d38a9875b208"
    group_mask: uint8
    height: float32
    duration: Time


@dataclass
class GoTo(IdlStruct):
    """As `Takeoff`; Crazyswarm2 sends radians as `yaw`."""

    ROS_NAME = "crazyflie_interfaces/srv/GoTo"
    ROS_HASH = "RIHS01_5ef2b5ac82f34a16abf356c3092a7d27006a9ab0dd0b88921c2f457ca293d9dc"
    group_mask: uint8
    relative: bool
    goal: Point
    yaw: float32
    duration: Time


@dataclass
class Empty(IdlStruct):
    """Request of `std_srvs/srv/Empty`, and response of all services here; DDS needs a member."""

    ROS_NAME = "std_srvs/srv/Empty"
    ROS_HASH = "RIHS01_5888399dedec5ccc85ea6451949fd2c9f97bfdf963f9a588821639fcd31b5d19"
    structure_needs_at_least_one_member: uint8 = 0
