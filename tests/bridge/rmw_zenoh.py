"""What a node of ROS 2 does on rmw_zenoh, by foreign hands: eclipse-zenoh carries, rosbags decodes and knows the types."""

import json
import struct
import threading
import time

import xxhash
import zenoh
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TYPES = get_typestore(Stores.ROS2_JAZZY)


def _service(name, request, response):
    """Registers a service, which rosbags does not know by itself."""
    def named(kind):
        return Nodetype.NAME, f"{name}{kind}"

    def base(kind, size=0):
        return Nodetype.BASE, (kind, size)

    defs = TYPES.fielddefs
    constants, fields = defs["service_msgs/msg/ServiceEventInfo"]
    # rosbags has the id as `char`, which has another number than the `uint8` that ROS itself hashes.
    defs["service_msgs/msg/ServiceEventInfo"] = constants, [
        (field, (Nodetype.ARRAY, (base("uint8"), 16)) if field == "client_gid" else kind) for field, kind in fields
    ]
    defs[f"{name}_Request"] = [], [(field, base(kind)) for field, kind in request]
    defs[f"{name}_Response"] = [], [(field, base(kind)) for field, kind in response]
    defs[f"{name}_Event"] = [], [
        ("info", (Nodetype.NAME, "service_msgs/msg/ServiceEventInfo")),
        ("request", (Nodetype.SEQUENCE, (named("_Request"), 1))),
        ("response", (Nodetype.SEQUENCE, (named("_Response"), 1))),
    ]
    defs[name] = [], [
        ("request_message", named("_Request")),
        ("response_message", named("_Response")),
        ("event_message", named("_Event")),
    ]


_service("std_srvs/srv/Trigger", [], [("success", "bool"), ("message", "string")])
# Only messages can be decoded, so the answer is one here.
ANSWER = "std_srvs/msg/TriggerAnswer"
TYPES.register(get_types_from_msg("bool success\nstring message\n", ANSWER))


def ros_type(dds):
    """`geometry_msgs::msg::dds_::WrenchStamped_` as people write it."""
    return dds.replace("::dds_::", "/").replace("::", "/").removesuffix("_")


def type_hash(dds):
    return TYPES.hash_rihs01(ros_type(dds))


class Attachment:
    def __init__(self, payload):
        raw = bytes(payload)
        assert len(raw) == 33 and raw[16] == 16, raw.hex()
        self.sequence, self.time_ns = struct.unpack("<qq", raw[:16])
        self.gid = raw[17:]

    @staticmethod
    def encode(sequence, gid):
        return struct.pack("<qqB", sequence, time.time_ns(), 16) + gid


def gid_of(token):
    digest = xxhash.xxh3_128_intdigest(token.encode())
    return digest.to_bytes(16, "little")


class Endpoint:
    """A liveliness token, as the graph of rmw_zenoh reads it."""

    def __init__(self, token):
        parts = token.split("/")
        assert parts[0] == "@ros2_lv" and all(parts), token
        self.token, self.kind, self.node = token, parts[5], parts[8]
        self.namespace = parts[7].replace("%", "/")
        if self.kind != "NN":
            assert len(parts) == 13, token
            self.name, self.type, self.hash, self.qos = parts[9].replace("%", "/"), *parts[10:]
            self.gid = gid_of(token)


class Graph:
    """Who is there, as `ros2 node list` and `ros2 topic list` know it: followed, not asked."""

    def __init__(self, session, domain):
        self.lock, self.tokens = threading.Lock(), {}
        self.subscriber = session.liveliness().declare_subscriber(f"@ros2_lv/{domain}/**", self._take, history=True)

    def _take(self, sample):
        with self.lock:
            key = str(sample.key_expr)
            if sample.kind == zenoh.SampleKind.PUT:
                self.tokens[key] = Endpoint(key)
            else:
                self.tokens.pop(key, None)

    def all(self, kind):
        with self.lock:
            return [endpoint for endpoint in self.tokens.values() if endpoint.kind == kind]

    def topics(self):
        return {endpoint.name: endpoint for endpoint in self.all("MP")}

    def services(self):
        return {endpoint.name: endpoint for endpoint in self.all("SS")}


class Topic:
    """Every message of a topic, decoded, with when it came (monotonic) and was sent (ns since 1970)."""

    def __init__(self, session, domain, endpoint):
        self.endpoint, self.messages, self.faults, self.lock = endpoint, [], [], threading.Lock()
        self.sequence, self.payload = 0, b""
        key = f"{domain}{endpoint.name}/{endpoint.type}/{endpoint.hash}"
        self.subscriber = session.declare_subscriber(key, self._take)

    def _take(self, sample):
        came = time.monotonic()
        try:
            attachment = Attachment(sample.attachment)
            assert attachment.gid == self.endpoint.gid, "the id is not that of the token"
            assert attachment.sequence > self.sequence, f"number {attachment.sequence} after {self.sequence}"
            self.sequence, self.payload = attachment.sequence, bytes(sample.payload)
            message = TYPES.deserialize_cdr(self.payload, ros_type(self.endpoint.type))
        except Exception as fault:  # this is a thread of Zenoh's: the test itself looks at `faults`
            self.faults.append(fault)
            return
        with self.lock:
            self.messages.append((came, attachment.time_ns, message))

    def since(self, count):
        with self.lock:
            return self.messages[count:]

    def count(self):
        with self.lock:
            return len(self.messages)


class TriggerClient:
    def __init__(self, session, domain, endpoint):
        self.session, self.endpoint, self.sequence = session, endpoint, 0
        self.key = f"{domain}{endpoint.name}/{endpoint.type}/{endpoint.hash}"
        self.gid = gid_of("a client of the tests")

    def call(self, timeout_s):
        self.sequence += 1
        replies = self.session.get(
            self.key, target=zenoh.QueryTarget.ALL_COMPLETE, consolidation=zenoh.ConsolidationMode.NONE,
            payload=bytes.fromhex("0001000000"), attachment=Attachment.encode(self.sequence, self.gid), timeout=timeout_s,
        )
        for reply in replies:
            assert reply.ok is not None, reply.err
            attachment = Attachment(reply.ok.attachment)
            assert (attachment.sequence, attachment.gid) == (self.sequence, self.gid)
            answer = TYPES.deserialize_cdr(bytes(reply.ok.payload), ANSWER)
            return answer.success, answer.message
        raise AssertionError(f"{self.endpoint.name} did not answer within {timeout_s} s")


def client(endpoint):
    """A session of a foreign implementation."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


class Ros:
    """What scene.py wants of a reader."""

    def __init__(self, endpoint, domain):
        self.session, self.domain = client(endpoint), domain
        self.graph = Graph(self.session, domain)

    def nodes(self):
        return {(endpoint.namespace, endpoint.node) for endpoint in self.graph.all("NN")}

    def topics(self):
        return {name: ros_type(endpoint.type) for name, endpoint in self.graph.topics().items()}

    def services(self):
        return {name: ros_type(endpoint.type) for name, endpoint in self.graph.services().items()}

    def subscribe(self, name):
        return Topic(self.session, self.domain, self.graph.topics()[name])

    def trigger(self, name):
        return TriggerClient(self.session, self.domain, self.graph.services()[name]).call
