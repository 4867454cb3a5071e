"""What a node has to live with in a soak: a sender at 1 kHz, half of it nonsense, and subscribers that come and go.

``python soak_clients.py sender`` or ``visitors``; each ends with its standard input, and prints what it did then.
"""

import itertools
import json
import math
import os
import random
import sys
import threading
import time

import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion, WrenchStamped
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64, Float64MultiArray, Header, String, UInt8MultiArray
from visualization_msgs.msg import MarkerArray

NODE = "/bilayer_sim"
RATE = 1000.0
"""Messages a second [Hz]."""
VISITORS = 50
"""Subscriptions at any time."""
STAY = 15.0
"""How long one stays, on average [s]."""
NAN, INF = math.nan, math.inf
LOW, HIGH, AWAY = 3e-3, 6e-3, 0.03
"""Heights that the body is sent to [m], and the one in poses that are refused."""


def pose(z, quaternion=(0.0, 0.0, 0.0, 1.0), frame="world"):
    """Where the scene's body should be [m]."""
    at, turned = Point(x=0.04, z=z), Quaternion(**dict(zip("xyzw", quaternion, strict=True)))
    return PoseStamped(header=Header(frame_id=frame), pose=Pose(position=at, orientation=turned))


def stamped(names, positions, seconds=0):
    """Values of channels that say which tick they answer."""
    stamp = Time(sec=seconds, nanosec=123)
    return JointState(header=Header(stamp=stamp), name=names, position=positions)


def good(generator):
    """What the node is to do, by topic."""
    value = generator.uniform(0.0, 1.0)
    yield "stimulus", Float64MultiArray(data=[value])
    yield "stimulus/heat", Float64(data=value)
    yield "stimulus_stamped", stamped(["heat"], [value])
    yield "load/push", Float64(data=value)
    yield "mount_pose/hand", pose(generator.uniform(LOW, HIGH))


def malformed(generator):
    """What it is to refuse, or to ignore."""
    names = ["heat", "heta", "", "heat" * 200]
    yield from (("stimulus", Float64MultiArray(data=data)) for data in ([], [NAN], [INF], [0.1, 0.2], [0.5] * 1000))
    yield from (("stimulus/heat", Float64(data=value)) for value in (NAN, -INF, -1.0, 1e300))
    yield from (("stimulus_stamped", stamped([name], [NAN], 2**31 - 1)) for name in names)
    yield "stimulus_stamped", stamped(["heat", "heat"], [0.1], -5)
    yield "stimulus_stamped", stamped([], [])
    yield "stimulus_stamped", stamped(["other"], [0.3], generator.randrange(1000))
    yield from (("load/push", Float64(data=value)) for value in (NAN, INF))
    yield "load/unknown", Float64(data=1.0)
    yield "mount_pose/unknown", pose(0.01)
    yield "mount_pose/hand", pose(AWAY, (NAN, 0.0, 0.0, 1.0))
    yield "mount_pose/hand", pose(AWAY, (0.0, 0.0, 0.0, 0.0))
    yield "mount_pose/hand", pose(NAN)
    yield "mount_pose/hand", pose(AWAY, frame="elsewhere")


def send(stop):
    """Send at `RATE`, one good and one malformed message by turns; how many."""
    rclpy.init()
    node, generator, publishers = Node("sender"), random.Random(1), {}
    count = 0
    pairs = itertools.chain.from_iterable(
        itertools.zip_longest(itertools.islice(itertools.cycle(good(generator)), 20), malformed(generator))
        for _ in itertools.count()
    )
    begin = time.monotonic()
    for topic, message in (of for pair in pairs for of in pair if of is not None):
        if stop.is_set():
            break
        if topic not in publishers:
            publishers[topic] = node.create_publisher(type(message), f"{NODE}/{topic}", 10)
        publishers[topic].publish(message)
        count += 1
        ahead = begin + count / RATE - time.monotonic()
        if ahead > 1e-3:
            time.sleep(ahead)
    rclpy.shutdown()
    return {"sent": count, "rate": count / (time.monotonic() - begin)}


TOPICS = {
    "/clock": Clock,
    f"{NODE}/nodes": PoseArray,
    f"{NODE}/points": PointCloud2,
    f"{NODE}/markers": MarkerArray,
    f"{NODE}/state": Float64MultiArray,
    f"{NODE}/energy": Float64MultiArray,
    f"{NODE}/stimulus_applied": Float64MultiArray,
    f"{NODE}/body_pose/hand": PoseStamped,
    f"{NODE}/clamp_wrench/hand": WrenchStamped,
    f"{NODE}/live": UInt8MultiArray,
    f"{NODE}/description": String,
}


def visit(stop):
    """Keep `VISITORS` subscriptions, each of random topic, reliability and stay; every few seconds all participants of
    a small group go and others come. Returns how many there were, and how many messages came.
    """
    generator = random.Random(2)
    count, received = 0, 0

    def heard(message):
        nonlocal received
        received += 1

    def subscribe(node):
        nonlocal count
        count += 1
        topic = generator.choice(list(TOPICS))
        kept, lossy = topic.endswith("description"), topic.endswith("live") or generator.random() < 0.5
        quality = QoSProfile(
            depth=generator.choice([1, 10, 100]),
            reliability=ReliabilityPolicy.BEST_EFFORT if lossy else ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        )
        return node.create_subscription(TOPICS[topic], topic, heard, quality)

    rclpy.init()
    node, executor = Node("visitors"), SingleThreadedExecutor()
    executor.add_node(node)
    visitors = [subscribe(node) for _ in range(VISITORS - 5)]
    guests, guests_since, changed = None, 0.0, time.monotonic()
    while not stop.is_set():
        executor.spin_once(timeout_sec=0.02)
        now = time.monotonic()
        if now - changed > STAY / VISITORS:
            changed = now
            node.destroy_subscription(visitors.pop(generator.randrange(len(visitors))))
            visitors.append(subscribe(node))
        if guests is None or now - guests_since > STAY / 2:
            if guests:
                guests[1].shutdown()
                guests[0].destroy_node()
                rclpy.shutdown(context=guests[2])
            context = Context()
            rclpy.init(context=context)
            guest = Node("guest", context=context)
            other = SingleThreadedExecutor(context=context)
            other.add_node(guest)
            for _ in range(5):
                subscribe(guest)
            guests, guests_since = (guest, other, context), now
        guests[1].spin_once(timeout_sec=0.0)
    executor.shutdown()
    guests[1].shutdown()
    rclpy.shutdown(context=guests[2])
    rclpy.shutdown()
    return {"subscriptions": count, "received": received}


def main():
    stop = threading.Event()

    def wait():
        while os.read(0, 1024):
            pass
        stop.set()

    threading.Thread(target=wait, daemon=True).start()
    print(json.dumps({"sender": send, "visitors": visit}[sys.argv[1]](stop)), flush=True)


if __name__ == "__main__":
    main()
