"""A real node of ROS 2: rclpy over Fast DDS, as PyPI has it."""

import os
import threading
import time

# Of this machine alone; the domain is that of the caller's bridge.
os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped, WrenchStamped  # noqa: E402
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: E402
from rclpy.qos import qos_profile_sensor_data, qos_profile_system_default  # noqa: E402
from sensor_msgs.msg import JointState, PointCloud2  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

TYPES = {
    f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}": kind
    for kind in [WrenchStamped, JointState, PointStamped, PointCloud2, DiagnosticArray]
}


class Topic:
    """Every message of a topic, with when it came (monotonic) and was sent (ns since 1970)."""

    def __init__(self, node, name, kind, profile=10):
        self.messages, self.faults, self.lock = [], [], threading.Lock()
        self.subscription = node.create_subscription(kind, name, self._take, profile)

    def _take(self, message, info):
        with self.lock:
            self.messages.append((time.monotonic(), info["source_timestamp"], message))

    def since(self, count):
        with self.lock:
            return self.messages[count:]

    def count(self):
        with self.lock:
            return len(self.messages)


class Ros:
    """What scene.py wants of a reader: a node of a domain, whose callbacks run on a thread of their own."""

    def __init__(self, domain, name="reader"):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        threading.Thread(target=self._spin, daemon=True).start()

    def _spin(self):
        try:
            self.executor.spin()
        except ExternalShutdownException:
            pass

    def nodes(self):
        return {(namespace, name) for name, namespace in self.node.get_node_names_and_namespaces()}

    def topics(self):
        published = [one for one in self.node.get_topic_names_and_types() if self.node.count_publishers(one[0])]
        return {name: types[0] for name, types in published}

    def services(self):
        return {name: types[0] for name, types in self.node.get_service_names_and_types()}

    def subscribe(self, name, profile=10):
        return Topic(self.node, name, TYPES[self.topics()[name]], profile)

    def trigger(self, name):
        client = self.node.create_client(Trigger, name)

        def call(timeout_s):
            assert client.wait_for_service(timeout_s), f"{name} is not there"
            done, future = threading.Event(), client.call_async(Trigger.Request())
            future.add_done_callback(lambda _: done.set())
            assert done.wait(timeout_s), f"{name} did not answer within {timeout_s} s"
            return future.result().success, future.result().message

        return call


PROFILES = {"reliable": qos_profile_system_default, "sensor data": qos_profile_sensor_data}
