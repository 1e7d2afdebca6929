"""Show a fleet to ROS 2: poses, plans and commands as standard messages, without ROS on this computer.

    python ros2_bridge.py --fleet trio --ros tcp/192.168.1.20:7447

needs rcopterx and pycdr2. Reads the fleet's bus and writes to the Zenoh router of ROS 2:
that of `rmw_zenoh` (default), or `zenoh-bridge-ros2dds` with `--keys ros2dds`. With `--commands`, ROS 2 also
commands the fleet (`ros_commands.py`).
"""

import argparse
import math
import threading
import time
import uuid
from contextlib import ExitStack, suppress
from functools import partial
from itertools import count

import msgpack
import numpy as np
import zenoh
from ros_commands import ALL, SERVICES, TOPICS, CommandError, Commands
from ros_messages import FRAME_ID, Header, Joy, Path, Point, Pose, PoseStamped, Quaternion, Time
from zenoh.ext import z_serialize

from rcopterx import Fleet
from rcopterx.bus.endpoints import client_config, open_session
from rcopterx.deploy.hosts.running import running_fleets

NODE = "rcopterx"
CONNECT_S = 5.0
PUBLISHER, SERVICE = "MP", "SS"
QUALITY = {PUBLISHER: "2::,1:,:,:,,", SERVICE: "::,10:,:,:,,"}
"""Best effort, keep the last one; reliable, keep the last ten."""


def ros_pose(message, now_s):
    """`geometry_msgs/PoseStamped` of a pose, stamped with the time of capture; None while it is occluded."""
    if message["occluded"]:
        return None
    header = Header(Time.at(now_s - message["latency_s"]), FRAME_ID)
    return PoseStamped(header, Pose(Point(*message["position_m"]), Quaternion(*message["quaternion_xyzw"])))


def ros_plan(message, now_s):
    """`nav_msgs/Path` of a plan: one stamped pose per stage.

    Times count from the arrival of the plan, which is some milliseconds after the capture that it means.
    """
    poses = []
    for number, (x, y, z, yaw_rad) in enumerate(positions_and_headings(message["trajectory"])):
        header = Header(Time.at(now_s + message["start_s"] + number * message["period_s"]), FRAME_ID)
        orientation = Quaternion(0.0, 0.0, math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad))
        poses.append(PoseStamped(header, Pose(Point(x, y, z), orientation)))
    return Path(Header(Time.at(now_s), FRAME_ID), poses)


def positions_and_headings(trajectory):
    """x, y, z [m] and yaw [rad] of every stage; see docs/messages.md."""
    counts = np.frombuffer(trajectory["data"], "<i2").reshape(12, -1).T
    return (counts * trajectory["scale"] + trajectory["offset"])[:, :4].tolist()


def ros_command(message, now_s):
    """`sensor_msgs/Joy` of a command: axes are pitch, roll, thrust, yaw."""
    return Joy(Header(Time.at(now_s), FRAME_ID), list(message["input"]), [])


CONVERTED = {"pose": ros_pose, "plan": ros_plan, "command": ros_command}
"""Topic of the fleet's bus and its message of ROS 2; the topic in ROS 2 is /FLEET/VEHICLE/TOPIC."""


def ros_key(topic, kind, keys, domain):
    """Key of a topic or service in ROS 2; of any type if `kind` is None.

    `rmw_zenoh`: domain, topic, type as DDS spells it, hash of the type. `ros2dds`: the topic without its
    leading slash.
    """
    if keys == "ros2dds":
        return topic
    return f"{domain}/{topic}/" + ("*/*" if kind is None else f"{dds_name(kind)}/{kind.ROS_HASH}")


def dds_name(kind):
    """`geometry_msgs::msg::dds_::PoseStamped_` of `geometry_msgs/msg/PoseStamped`."""
    package, folder, name = kind.ROS_NAME.split("/")
    return f"{package}::{folder}::dds_::{name}_"


def attachment(number, now_s, publisher_id):
    """Attachment of `rmw_zenoh` to every message: count, time [ns], 16 bytes that name the publisher."""
    fields = (
        ("sequence_number", zenoh.ext.Int64(number)),
        ("source_timestamp", zenoh.ext.Int64(round(now_s * 1e9))),
        ("source_gid", publisher_id),
    )
    return b"".join(z_serialize(name).to_bytes() + z_serialize(value).to_bytes() for name, value in fields)


def node_token(domain, session_id):
    """Token by which `ros2 node list` finds the bridge."""
    return f"@ros2_lv/{domain}/{session_id}/0/0/NN/%/%/{NODE}"


def entity_token(domain, session_id, number, entity, name, kind):
    """Token by which `ros2 topic list` finds a publisher, and clients a service: entities of `QUALITY`."""
    node = f"@ros2_lv/{domain}/{session_id}/0/{number}/{entity}/%/%/{NODE}"
    return f"{node}/%{name.replace('/', '%')}/{dds_name(kind)}/{kind.ROS_HASH}/{QUALITY[entity]}"


class Topic:
    """One topic in ROS 2: its publisher, its token, its count of messages."""

    def __init__(self, session, key, token):
        self._publisher = session.declare_publisher(key, congestion_control=zenoh.CongestionControl.DROP)
        self._token = session.liveliness().declare_token(token)
        self._id = uuid.uuid4().bytes
        self._number = 0

    def put(self, message, now_s):
        """Publish a message of ROS 2."""
        self._number += 1
        self._publisher.put(message.serialize(), attachment=attachment(self._number, now_s, self._id))


class Bridge:
    """Republishes messages of the fleet while it is open.

    `rcopterx` and `ros` are the endpoints of the two routers, `namespace` and `ros_namespace` their Zenoh
    namespaces, if any; `keys` is `rmw_zenoh` or `ros2dds`, which does not use `domain`, the ROS_DOMAIN_ID.
    """

    def __init__(self, fleet, rcopterx, ros, keys="rmw_zenoh", domain=0, namespace=None, ros_namespace=None):
        self._fleet, self._keys, self._domain = fleet, keys, domain
        self._topics = {}
        self._numbers = count(1)  # of publishers and services
        self._obeyed = []  # subscribers, services and their tokens
        self._one_at_a_time = threading.Lock()  # pycdr2 writes every message of a type into the same buffer
        self._ros = open_session(client_config([ros], ros_namespace, CONNECT_S))
        self._id = str(self._ros.zid())
        self._node = self._ros.liveliness().declare_token(node_token(domain, self._id))
        self._bus = open_session(client_config([rcopterx], namespace, CONNECT_S))
        self._subscribers = [
            self._bus.declare_subscriber(f"rcopterx/{fleet}/*/{name}", self._on_sample) for name in CONVERTED
        ]

    def obey(self, fleet, report=print):
        """Let ROS 2 command a fleet, which the caller has joined and closes.

        The bridge of DDS has topics only: it offers the services of programs to ROS 2 by its configuration.
        """
        commands = Commands(fleet, report)
        for name in TOPICS:
            key = ros_key(f"{self._fleet}/*/{name}", None, self._keys, self._domain)
            received = partial(self._on_command, commands, name)
            self._obeyed.append(self._ros.declare_subscriber(key, received))
        if self._keys == "rmw_zenoh":
            for vehicle in (*fleet.file.vehicles, ALL):
                for name in SERVICES:
                    self._serve(commands, vehicle, name)

    def _serve(self, commands, vehicle, name):
        kind, service = SERVICES[name], f"{self._fleet}/{vehicle}/{name}"
        answer = partial(self._on_request, commands, vehicle, name)
        key = ros_key(service, kind, self._keys, self._domain)
        token = entity_token(self._domain, self._id, next(self._numbers), SERVICE, service, kind)
        self._obeyed.append(self._ros.declare_queryable(key, answer, complete=True))
        self._obeyed.append(self._ros.liveliness().declare_token(token))

    @staticmethod
    def _on_command(commands, name, sample):
        parts = str(sample.key_expr).split("/")
        commands.receive(name, parts[parts.index(name) - 1], sample.payload.to_bytes())

    @staticmethod
    def _on_request(commands, vehicle, name, query):
        payload = b"" if query.payload is None else query.payload.to_bytes()
        try:
            response = commands.answer(name, vehicle, payload)
        except CommandError as error:
            query.reply_err(str(error).encode())
        else:
            # The client finds its request by the attachment, which it also expects with the response.
            query.reply(query.key_expr, response, attachment=query.attachment)

    def close(self):
        """Leave both sides."""
        self._bus.close()
        self._ros.close()

    def _on_sample(self, sample):
        now_s = time.time()
        vehicle, name = str(sample.key_expr).split("/")[-2:]
        message = CONVERTED[name](msgpack.unpackb(sample.payload.to_bytes()), now_s)
        if message is None:
            return
        with self._one_at_a_time:
            self._topic(f"{self._fleet}/{vehicle}/{name}", type(message)).put(message, now_s)

    def _topic(self, topic, kind):
        if topic not in self._topics:
            token = entity_token(self._domain, self._id, next(self._numbers), PUBLISHER, topic, kind)
            self._topics[topic] = Topic(self._ros, ros_key(topic, kind, self._keys, self._domain), token)
        return self._topics[topic]


def running_fleet(name):
    """Record of the fleet of this name that is up on this computer; None if it is not."""
    return next((running for running in running_fleets() if running.fleet == name), None)


def main():
    """Bridge until Ctrl-C."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--fleet", default="trio")
    options.add_argument("--rcopterx", help="router of the fleet; default: that of this computer")
    options.add_argument("--ros", required=True, help="router of ROS 2")
    options.add_argument("--keys", choices=("rmw_zenoh", "ros2dds"), default="rmw_zenoh")
    options.add_argument("--domain", type=int, default=0, help="ROS_DOMAIN_ID")
    options.add_argument("--commands", action="store_true", help="ROS 2 commands the fleet")
    chosen = options.parse_args()
    name, here = chosen.fleet, running_fleet(chosen.fleet)
    if here is None and chosen.rcopterx is None:
        raise SystemExit(f"{name} is not up on this computer; give the address of its router by --rcopterx")
    bridge = Bridge(name, chosen.rcopterx or here.endpoints[0], chosen.ros, chosen.keys, chosen.domain)
    with ExitStack() as stack:
        stack.callback(bridge.close)
        if chosen.commands:
            fleet = Fleet.connect(name) if here is None else Fleet.connect(here.snapshot, here.host)
            bridge.obey(stack.enter_context(fleet))
        with suppress(KeyboardInterrupt):
            while True:
                time.sleep(1.0)


if __name__ == "__main__":
    main()
