"""MCAP files with the skin of a link: written with layout, readings, frames and calibration; readings are read."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np

from .. import __version__
from ..calibration.file import to_document
from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..common.encoding import encode as encode_json
from ..common.errors import CalibrationFormatError, listed
from ..common.findings import show
from ..common.packages import optional_package
from ..common.strict_json import size_of
from ..runtime import Frame, Skin
from ..runtime.modalities import FORCE
from .cdr import decode, encode
from .content import frame_message, layout_message, nanoseconds, reading_message, reading_of, seconds
from .definitions import PACKAGE, fields_in, fields_of, full_name, schema_text

# [bytes] of a chunk. Larger: smaller files, but a recorder that is killed loses more readings.
CHUNK_SIZE = 2**20
# [bytes] of a chunk that is written while the robot runs, with a quick compression: it delays a frame by 0.3 ms instead
# of 4 ms, and files are 1.8 times as large. Larger: longer delays.
LIVE_CHUNK_SIZE = 2**17
# [bytes] Limit of a chunk that is read, compressed or not. It protects the memory. Larger: accepts larger chunks.
MAX_CHUNK_SIZE = 2**29
FOREVER = "{sec: 9223372036, nsec: 854775807}"  # Derived: RMW_DURATION_INFINITE
# Quality of service of a topic, complete: readers refuse a part of it. 1 and 1: keep last, reliable.
QOS = f"""- history: 1
  depth: %d
  reliability: 1
  durability: %d
  deadline: {FOREVER}
  lifespan: {FOREVER}
  liveliness: 1
  liveliness_lease_duration: {FOREVER}
  avoid_ros_namespace_conventions: false
"""
TRANSIENT_LOCAL, VOLATILE = 1, 2  # Derived: of rmw
# Contract: message, depth and durability of each topic
TOPICS = {
    "layout": ("TaxelLayout", 1, TRANSIENT_LOCAL),
    "reading": ("SkinReading", 10, VOLATILE),
    "frame": ("SkinFrame", 10, VOLATILE),
}
READING = f"{PACKAGE}/msg/SkinReading"
# What is measured at touches, by the names of their messages: the field, and how many numbers it has.
PROBES = {"geometry_msgs/msg/WrenchStamped": ("wrench", 6), "geometry_msgs/msg/PointStamped": ("point", 3)}


def _library() -> Any:
    """Return the package that reads and writes MCAP."""
    with optional_package("MCAP files need the package mcap", "live"):
        import mcap.stream_reader
        import mcap.writer
    return mcap


def topic_of(link: str, name: str) -> str:
    """Return the topic of a link; characters that names of topics cannot have become an underscore."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", link)
    return f"/skin/{'_' * word[:1].isdigit()}{word}/{name}"


class McapSkin:
    """Write the skin of a link to a stream as MCAP, frame by frame; closing it completes the file."""

    topics = TOPICS

    def __init__(self, stream: IO[bytes], calibration: LinkCalibration, skin: Skin, time: float, is_live: bool = False):
        """Write calibration and layout, with the time of the first frame [s]; short delays if it is live."""
        mcap = _library()
        self._link, self._checksum = skin.link, skin.checksum
        kinds, size = mcap.writer.CompressionType, LIVE_CHUNK_SIZE if is_live else CHUNK_SIZE
        self._writer = mcap.writer.Writer(stream, size, kinds.LZ4 if is_live else kinds.ZSTD)
        self._writer.start("ros2", f"skin-calib {__version__}")
        self._channels = {name: self._register(name, *of) for name, of in self.topics.items()}
        name, at = f"{skin.link}.calibration.json", max(nanoseconds(time), 0)
        self._writer.add_attachment(0, at, name, "application/json", encode_json(to_document(calibration)))
        self.write("layout", encode("TaxelLayout", layout_message(calibration, skin, time)), time, 0)

    def _register(self, topic: str, message: str, depth: int, durability: int) -> int:
        kind, text = full_name(message).replace("/", "/msg/"), schema_text(message)
        schema = self._writer.register_schema(kind, "ros2msg", text.encode())
        qos = {"offered_qos_profiles": QOS % (depth, durability)}
        return int(self._writer.register_channel(topic_of(self._link, topic), "cdr", schema, qos))

    def write(self, topic: str, data: bytes, time: float, cycle: int) -> None:
        """Write the bytes of a message on one of the topics, with its time [s]."""
        at = max(nanoseconds(time), 0)  # stamps can be negative, times of MCAP cannot
        self._writer.add_message(self._channels[topic], at, data, at, cycle % 2**32)

    def add(self, readings: Mapping[str, Array], frame: Frame, cycle: int, lost: int = 0) -> None:
        """Write the readings (channels,) of a cycle by their quantities, and the frame that they gave.

        A time of the frame that is not finite, or does not fit into a message, raises an InvalidReading.
        """
        for name, reading in readings.items():
            message = reading_message(self._link, reading, frame.time, cycle, lost, self._checksum, name)
            self.write("reading", encode("SkinReading", message), frame.time, cycle)
        message = frame_message(self._link, frame, cycle, lost, self._checksum)
        self.write("frame", encode("SkinFrame", message), frame.time, cycle)

    def close(self) -> None:
        """Complete the file."""
        self._writer.finish()

    def __enter__(self) -> "McapSkin":
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if error is None:
            self.close()


class RecordedReadings:
    """Readings of a link in an MCAP file, in the order of the file."""

    def __init__(self, path: Path, link: str, limit: int, with_probes: bool = False):
        """Read them, at most ``limit`` numbers; ``with_probes`` also wrenches and points in the frame of the link."""
        self.times: list[float] = []  # [s]
        self.cycles: list[int] = []
        self.readings: list[Array] = []
        self.calibrations: set[str] = set()  # checksums that the readings name
        self.is_cut = False  # whether the file ends early
        self.probes: dict[str, list[Array]] = {field: [] for field, _ in PROBES.values()}  # time [s], then the numbers
        self.frames: set[str] = set()  # of wrenches and points
        self._others: dict[tuple[int, int, str], Array] = {}  # by nanoseconds, cycle, quantity
        self._keys: list[tuple[int, int]] = []
        size_of(path)
        numbers, links = 0, set()
        for kind, message in self._messages(path, (READING, *PROBES) if with_probes else (READING,)):
            if kind in PROBES:
                (field, count), frame = PROBES[kind], message["header"]["frame_id"]
                numbers += count + 1
                self.frames.add(frame)
                if frame == link:
                    self.probes[field].append(np.append(seconds(message["header"]["stamp"]), message[field]))
                continue
            links.add(message["header"]["frame_id"])
            if message["header"]["frame_id"] != link:
                continue
            time, reading = reading_of(message)
            stamp = message["header"]["stamp"]
            key = (stamp["sec"] * 10**9 + stamp["nanosec"], message["cycle"])
            numbers += max(len(reading), 1)
            if numbers > limit:
                raise CalibrationFormatError(f"'{path}' has more than {limit} numbers. Split the file")
            if message["quantity"] != FORCE:
                self._others[(*key, message["quantity"])] = reading
                continue
            self._keys.append(key)
            self.times.append(time)
            self.cycles.append(message["cycle"])
            self.readings.append(reading)
            self.calibrations.update({message["calibration"]} - {""})
        if not self.readings and self.is_cut:
            raise CalibrationFormatError(
                f"'{path}' ends early, before the first reading of {show(link)}. Record it again"
            )
        if not self.readings:
            what = f"only of {listed(sorted(map(show, links)))}" if links else "and none of another link"
            raise CalibrationFormatError(
                f"'{path}' has no readings of {show(link)}, {what}. Record {READING} with this frame_id"
            )

    def of(self, quantity: str) -> Array | None:
        """Return the readings (t, channels) of another quantity, NaN where a cycle has none; None without any."""
        rows = [self._others.get((*key, quantity)) for key in self._keys]
        known = [row for row in rows if row is not None]
        if not known:
            return None
        width = max(map(len, known))
        table = np.full((len(rows), width), np.nan)
        for k, row in enumerate(rows):
            if row is not None:
                table[k, : len(row)] = row
        return table

    @property
    def missing(self) -> int:
        """Number of readings that are missing by their cycles."""
        steps = np.diff(np.array(self.cycles, object))
        return int(sum(step - 1 for step in steps if step > 1))

    @property
    def restarts(self) -> int:
        """How often the cycles begin again."""
        return int(sum(step < 0 for step in np.diff(np.array(self.cycles, object))))

    def _messages(self, path: Path, kinds: tuple[str, ...]) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield each message of some kinds, with its kind."""
        mcap = _library()
        schemas, wanted = {}, dict[int, str]()
        try:
            with open(path, "rb") as stream:
                for record in _records(mcap, stream):
                    if isinstance(record, mcap.records.Schema):
                        schemas[record.id] = record
                    elif isinstance(record, mcap.records.Channel):
                        schema = schemas.get(record.schema_id)
                        if schema is not None and schema.name in kinds:
                            _check(path, record, schema)
                            wanted[record.id] = schema.name
                    elif isinstance(record, mcap.records.Message) and record.channel_id in wanted:
                        kind = wanted[record.channel_id]
                        yield kind, decode(kind.replace("/msg/", "/").removeprefix(f"{PACKAGE}/"), record.data)
        except mcap.exceptions.EndOfFile:
            self.is_cut = True
        except CalibrationFormatError as problem:
            if str(path) in str(problem):
                raise
            raise CalibrationFormatError(f"'{path}': {problem}") from problem
        except Exception as problem:  # the readers raise many types of exceptions for damaged files
            raise CalibrationFormatError(f"cannot read '{path}': {problem}. Record it again") from problem


def _records(mcap: Any, stream: IO[bytes]) -> Iterator[Any]:
    """Yield the records of a file in their order, also those in chunks."""
    reader = mcap.stream_reader.StreamReader(stream, emit_chunks=True, record_size_limit=MAX_CHUNK_SIZE)
    for record in reader.records:
        if isinstance(record, mcap.records.Chunk):
            if record.uncompressed_size > MAX_CHUNK_SIZE:
                raise ValueError(f"a chunk has {record.uncompressed_size} bytes, more than {MAX_CHUNK_SIZE}")
            yield from mcap.stream_reader.breakup_chunk(record, validate_crc=True)
        else:
            yield record
            if isinstance(record, mcap.records.DataEnd):  # what follows repeats schemas and channels
                return


def _check(path: Path, channel: Any, schema: Any) -> None:
    """Refuse messages in another form than that of their definition here."""
    if channel.message_encoding != "cdr" or schema.encoding != "ros2msg":
        what = f"{show(channel.message_encoding)} and {show(schema.encoding)}"
        raise CalibrationFormatError(
            f"'{path}', topic {show(channel.topic)}: the encodings are {what}, not cdr and ros2msg"
        )
    text = schema.data.decode("utf-8", "replace").partition("=" * 80)[0]
    package, _, name = schema.name.split("/")
    if fields_in(text, package) != fields_of(f"{package}/{name}"):
        raise CalibrationFormatError(
            f"'{path}', topic {show(channel.topic)}: the file has another definition of {schema.name}. Record it with "
            "the messages of this version"
        )
