"""Where messages go: MCAP files and UDP; ``dds`` has ROS 2."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..calibration.model import LinkCalibration
from ..common.errors import OutputError
from ..messages.mcap_file import McapSkin
from ..runtime import Skin

# [taxels] Frames with more of them can be larger than a datagram, 65 507 bytes: 12 bytes for each taxel, and 8 for each
# other quantity.
MAX_UDP_TAXELS = 3000


class Output:
    """A target of messages, in the bytes of ROS 2 (CDR)."""

    text: str  # what it is
    topics: tuple[str, ...] = ("frame",)  # what it wants, see messages.mcap_file.TOPICS
    unsent = 0  # messages that could not be sent
    reason = ""  # why, of the last one
    failure: OutputError | None = None  # after which it gets no messages

    def send(self, topic: str, data: bytes, time: float, cycle: int) -> None:
        """Publish a message of a reading with its time [s] and its number; a layout is the first."""

    def close(self) -> None:
        """Complete what was written."""


class McapOutput(Output):
    """Write an MCAP file with layout, readings and frames. A file that exists is not replaced.

    Without a frame there is no file.
    """

    topics = ("layout", "reading", "frame")

    def __init__(self, path: Path, calibration: LinkCalibration, skin: Skin):
        self.text, self._calibration, self._skin = str(path), calibration, skin
        self._file: McapSkin | None = None
        with self._naming():
            self._stream = open(path, "xb")  # noqa: SIM115, closed by close

    @contextmanager
    def _naming(self) -> Iterator[None]:
        """Name the file in errors."""
        try:
            yield
        except OSError as problem:
            advice = "Choose another name or folder, or free disk space"
            raise OutputError(f"cannot write '{self.text}': {problem.strerror}. {advice}") from problem

    def send(self, topic: str, data: bytes, time: float, cycle: int) -> None:
        """Write a message."""
        with self._naming():
            if self._file is None:  # it begins with the layout
                self._file = McapSkin(self._stream, self._calibration, self._skin, time, is_live=True)
            else:
                self._file.write(topic, data, time, cycle)

    def close(self) -> None:
        """Complete the file, or raise what has ended it."""
        with self._naming(), self._stream:
            if self.failure:
                raise self.failure
            if self._file is None:
                Path(self.text).unlink(missing_ok=True)
            else:
                self._file.close()


class UdpOutput(Output):
    """Send each frame as a datagram."""

    def __init__(self, host: str, port: int, skin: Skin):
        self.text = f"UDP {host}:{port}"
        if len(skin.ids) > MAX_UDP_TAXELS:
            raise OutputError(f"a datagram has no space for a frame of {len(skin.ids)} taxels. Use another output")
        try:
            self._target = (socket.gethostbyname(host), port)
        except OSError as problem:
            raise OutputError(f"unknown host '{host}': {problem}. Check its name") from problem
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, topic: str, data: bytes, time: float, cycle: int) -> None:
        """Send a message."""
        try:
            self._socket.sendto(data, self._target)
        except OSError as problem:
            self.unsent, self.reason = self.unsent + 1, str(problem.strerror)

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()
