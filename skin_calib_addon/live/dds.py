"""Publish to ROS 2 over DDS with ``cyclonedds``: topics, types and quality of service as ROS 2 names them."""

import os
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from typing import Any

from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..common.errors import SkinCalibError
from ..messages.cdr import encode
from ..messages.content import frame_message, layout_message
from ..messages.definitions import PACKAGE, PRIMITIVES, fields_of
from ..messages.mcap_file import TOPICS, TRANSIENT_LOCAL, topic_of
from ..runtime import Frame, Skin

# Only programs of this computer, and no multicast, which a loopback device does not have. CYCLONEDDS_URI replaces it.
LOOPBACK = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer Address="127.0.0.1"/></Peers></Discovery></Domain>
</CycloneDDS>"""
BLOCKING_MS = 2  # [ms] for which a slow reader may delay a frame; then this frame is not sent. Larger: longer delays


def _library() -> Any:
    """Return the package for DDS."""
    try:
        import cyclonedds.domain
        import cyclonedds.idl
        import cyclonedds.pub
        import cyclonedds.qos
        import cyclonedds.topic
        import cyclonedds.util
    except ImportError as error:
        raise SkinCalibError(
            "DDS needs the package cyclonedds, which is not installed here: pip install 'skin-calib[live]'"
        ) from error
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


class DdsOutput:
    """Publish layout (latched) and frames in the domain ``ROS_DOMAIN_ID``."""

    def __init__(self, calibration: LinkCalibration, skin: Skin):
        dds = _library()
        self._calibration, self._skin, self.unsent, self.reason = calibration, skin, 0, ""
        number, is_local = int(os.environ.get("ROS_DOMAIN_ID") or 0), "CYCLONEDDS_URI" not in os.environ
        try:
            self._domain = dds.domain.Domain(number, LOOPBACK) if is_local else None
            self._participant = dds.domain.DomainParticipant(number)
            self._writers = {name: self._writer(name) for name in ("layout", "frame")}
        except dds.core.DDSException as problem:
            raise SkinCalibError(f"cannot use DDS domain {number}: {problem}. Check CYCLONEDDS_URI") from problem
        self._problem = dds.core.DDSException
        self.text = f"DDS domain {number}, {'this computer only' if is_local else 'as in CYCLONEDDS_URI'}"

    def _writer(self, topic: str) -> Any:
        dds, (message, depth, durability) = _library(), TOPICS[topic]
        policy = dds.qos.Policy
        latched = policy.Durability.TransientLocal if durability == TRANSIENT_LOCAL else policy.Durability.Volatile
        qos = dds.qos.Qos(
            policy.Reliability.Reliable(dds.util.duration(milliseconds=BLOCKING_MS)),
            latched,
            policy.History.KeepLast(depth),
        )
        name, kind = f"rt{topic_of(self._skin.link, topic)}", type_of(f"{PACKAGE}/{message}")
        return dds.pub.DataWriter(self._participant, dds.topic.Topic(self._participant, name, kind, qos), qos)

    def _write(self, topic: str, message: Mapping[str, Any]) -> None:
        writer = self._writers[topic]
        sample = writer.data_type.__new__(writer.data_type)
        sample.data = encode(TOPICS[topic][0], message)
        try:
            writer.write(sample)
        except self._problem as problem:
            self.unsent, self.reason = self.unsent + 1, str(problem)

    def layout(self, time: float) -> None:
        """Publish the taxels, also for readers that start later."""
        self._write("layout", layout_message(self._calibration, self._skin, time))

    def frame(self, readings: Mapping[str, Array], frame: Frame, cycle: int, lost: int) -> None:
        """Publish a frame."""
        self._write("frame", frame_message(self._skin.link, frame, cycle, lost, self._skin.checksum))

    def close(self) -> None:
        """Give readers a second for the last frames, and leave the domain."""
        with suppress(self._problem, AttributeError):  # cyclonedds 11.0.1 has a wrong name where it is too short
            self._writers["frame"].wait_for_acks(_library().util.duration(seconds=1))
        self._writers.clear()
        self._participant = self._domain = None
