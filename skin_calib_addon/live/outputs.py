"""Where frames go: MCAP files and UDP; ``dds`` has ROS 2."""

import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..common.errors import OutputError
from ..messages.cdr import encode
from ..messages.content import frame_message
from ..messages.mcap_file import McapSkin
from ..runtime import Frame, Skin

# [taxels] Up to so many, frames over UDP have the forces: a datagram has 65 507 bytes at most, a taxel takes 12 to 20.
# Larger: frames with many contacts are not sent.
MAX_UDP_FORCES = 3000


class Output(Protocol):
    """A target of frames."""

    text: str  # what it is
    unsent: int  # frames that could not be sent
    reason: str  # why, of the last one

    def layout(self, time: float) -> None:
        """Publish the taxels: before the first frame, and after each change of the noise."""

    def frame(self, readings: Mapping[str, Array], frame: Frame, cycle: int, lost: int) -> None:
        """Publish a frame, with the readings by their quantities from which it was computed."""

    def close(self) -> None:
        """Complete what was written."""


class McapOutput:
    """Write an MCAP file with layout, readings and frames. A file that exists is not replaced."""

    unsent, reason = 0, ""

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

    def layout(self, time: float) -> None:
        """Write the taxels."""
        with self._naming():
            if self._file is None:
                self._file = McapSkin(self._stream, self._calibration, self._skin, time)
            else:
                self._file.add_layout(time)

    def frame(self, readings: Mapping[str, Array], frame: Frame, cycle: int, lost: int) -> None:
        """Write readings and frame, after the layout."""
        assert self._file is not None
        with self._naming():
            self._file.add(readings, frame, cycle, lost)

    def close(self) -> None:
        """Complete the file."""
        with self._naming(), self._stream:
            if self._file is None:
                self.layout(0.0)
            if self._file is not None:
                self._file.close()


class UdpOutput:
    """Send each frame as a datagram: a ``SkinFrame`` in the bytes of ROS 2 (CDR)."""

    def __init__(self, host: str, port: int, skin: Skin):
        self._skin, self.unsent, self.reason = skin, 0, ""
        self._with_forces = len(skin.ids) <= MAX_UDP_FORCES
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._target = (socket.gethostbyname(host), port)
        except OSError as problem:
            raise OutputError(f"unknown host '{host}': {problem}. Check its name") from problem
        self.text = f"UDP {host}:{port}{'' if self._with_forces else ', without forces: there are too many'}"

    def layout(self, time: float) -> None:
        """Do nothing: a receiver has the calibration file."""

    def frame(self, readings: Mapping[str, Array], frame: Frame, cycle: int, lost: int) -> None:
        """Send a frame."""
        message = frame_message(self._skin.link, frame, cycle, lost, self._skin.checksum, self._with_forces)
        try:
            self._socket.sendto(encode("SkinFrame", message), self._target)
        except OSError as problem:
            self.unsent, self.reason = self.unsent + 1, str(problem.strerror)

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()
