"""Publish to ROS 2 over DDS with ``cyclonedds``: topics, types and quality of service as ROS 2 names them."""

import os
from contextlib import suppress
from functools import cache
from typing import Any

from ..common.errors import SkinCalibError
from ..common.packages import optional_package
from ..messages.definitions import PACKAGE, PRIMITIVES, fields_of
from ..messages.mcap_file import TOPICS, TRANSIENT_LOCAL, topic_of
from .outputs import Output

# Only programs of this computer, and no multicast, which a loopback device does not have. A frame is one packet of it,
# and a packet that gets lost is missed after 5 ms (by default: 100 ms). CYCLONEDDS_URI replaces all of it.
LOOPBACK = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast><MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize></General>
<Internal><HeartbeatInterval min="2ms" minsched="2ms" max="1s">5ms</HeartbeatInterval></Internal><Discovery>
<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers>
<Peer Address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
MAX_DOMAIN = 232  # Derived: the ports of higher ones do not exist
BLOCKING_MS = 2  # [ms] for which a slow reader may delay a frame; then this frame is not sent. Larger: longer delays


def _library() -> Any:
    """Return the package for DDS."""
    with optional_package("DDS needs the package cyclonedds", "live"):
        import cyclonedds.domain
        import cyclonedds.idl
        import cyclonedds.pub
        import cyclonedds.qos
        import cyclonedds.topic
        import cyclonedds.util
    return cyclonedds


@cache
def type_of(kind: str) -> Any:
    """Return the class of a message by its full name. The bytes of a sample are those in its ``data``."""
    types = _library().idl.types
    package, name = kind.split("/")
    fields = {}
    for field in fields_of(kind):
        one = {"bool": bool, "string": str, "float64": types.float64}.get(field.kind)
        one = one or (getattr(types, field.kind) if field.kind in PRIMITIVES else type_of(field.kind))
        if field.length is not None:
            one = types.array[one, field.length] if field.length else types.sequence[one]
        fields[field.name] = one
    made = _library().idl.make_idl_struct(name, f"{package}.msg.dds_.{name}_", fields)
    made.serialize = lambda sample, **_: sample.data
    return made


class DdsOutput(Output):
    """Publish layout (latched) and frames in the domain ``ROS_DOMAIN_ID``."""

    topics = ("layout", "frame")

    def __init__(self, link: str):
        dds = _library()
        self._problem = dds.core.DDSException
        text, is_local = os.environ.get("ROS_DOMAIN_ID") or "0", "CYCLONEDDS_URI" not in os.environ
        if not text.isdecimal() or int(text) > MAX_DOMAIN:
            raise SkinCalibError(f"ROS_DOMAIN_ID is {text!r}. Set a number from 0 to {MAX_DOMAIN}")
        number = int(text)
        try:
            self._domain = dds.domain.Domain(number, LOOPBACK) if is_local else None
            participant = dds.domain.DomainParticipant(number)
            self._writers = {topic: _writer(participant, link, topic) for topic in self.topics}
        except dds.core.DDSException as problem:
            raise SkinCalibError(f"cannot use DDS domain {number}: {problem}. Check CYCLONEDDS_URI") from problem
        self.text = f"DDS domain {number}, {'this computer only' if is_local else 'as in CYCLONEDDS_URI'}"

    def send(self, topic: str, data: bytes, time: float, cycle: int) -> None:
        """Publish a message."""
        writer = self._writers[topic]
        sample = writer.data_type.__new__(writer.data_type)
        sample.data = data
        try:
            writer.write(sample)
        except self._problem as problem:
            self.unsent, self.reason = self.unsent + 1, str(problem)

    def close(self) -> None:
        """Give readers a second for the last frames, and leave the domain."""
        with suppress(self._problem, AttributeError):  # cyclonedds 11.0.1 has a wrong name where it is too short
            self._writers["frame"].wait_for_acks(_library().util.duration(seconds=1))
        self._writers.clear()
        self._domain = None


def _writer(participant: Any, link: str, topic: str) -> Any:
    """Return what publishes on a topic."""
    dds, (message, depth, durability) = _library(), TOPICS[topic]
    policy = dds.qos.Policy
    latched = policy.Durability.TransientLocal if durability == TRANSIENT_LOCAL else policy.Durability.Volatile
    reliable = policy.Reliability.Reliable(dds.util.duration(milliseconds=BLOCKING_MS))
    qos, kind = dds.qos.Qos(reliable, latched, policy.History.KeepLast(depth)), type_of(f"{PACKAGE}/{message}")
    return dds.pub.DataWriter(participant, dds.topic.Topic(participant, f"rt{topic_of(link, topic)}", kind, qos), qos)
