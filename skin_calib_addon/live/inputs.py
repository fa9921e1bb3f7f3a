"""Where readings come from: UDP, a serial line, or a recording that is played at its own speed."""

import socket
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from ..common.errors import SkinCalibError
from ..common.packages import optional_package
from ..inspection.recording import read_recording
from ..messages.packet import Reading
from ..runtime import Skin

# [s] An input without bytes returns after this time. Larger: a later end after Ctrl+C; smaller: it wakes for nothing.
WAIT = 0.1
# [bytes] that the system keeps while the program is busy, if it allows so many: 1.6 s of 1260 channels of 16 bits at
# 1 kHz. Larger: longer interruptions lose no reading, and give old ones.
BUFFER = 2**22
# [s] A longer pause of a recording is left out. Larger: recordings with interruptions play longer.
MAX_PAUSE = 1.0


class Decode(Protocol):
    """Find readings in bytes, as :class:`.Decoder` does."""

    def feed(self, data: bytes, is_datagram: bool, /) -> list[Reading]:
        """Return the readings that are complete after these bytes."""


class Input:
    """A source of readings."""

    text: str  # what it is
    notes: Sequence[str] = ()  # what a person should know of it

    def read(self) -> list[Reading] | None:
        """Return what has arrived, after ``WAIT`` without bytes nothing, at the end None."""
        raise NotImplementedError

    def close(self) -> None:
        """Close it."""


class UdpInput(Input):
    """Receive datagrams at a port of an address of this computer."""

    def __init__(self, address: str, port: int, decoder: Decode):
        self._decoder, self._socket = decoder, socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
            self._socket.bind((address, port))
        except OSError as problem:
            self._socket.close()
            advice = "Close the program that uses this port, or name an address of this computer"
            raise SkinCalibError(f"cannot receive at UDP {address}:{port}: {problem}. {advice}") from problem
        self._socket.settimeout(WAIT)
        kilobytes = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 1024
        self.text = f"UDP {address}:{port}, buffer of {kilobytes} kB"

    def read(self) -> list[Reading]:
        """Return the readings of a datagram."""
        try:
            data = self._socket.recv(65536)
        except TimeoutError:
            return []
        return self._decoder.feed(data, True)

    def close(self) -> None:
        """Release the port."""
        self._socket.close()


class SerialInput(Input):
    """Read a serial line."""

    def __init__(self, device: str, baud: int, decoder: Decode):
        with optional_package("serial lines need the package pyserial", "live"):
            import serial
        self._problem: type[Exception] = serial.SerialException
        try:
            self._port: Any = serial.Serial(device, baud, timeout=WAIT)
            self._port.write(getattr(decoder, "start", b""))
        except (serial.SerialException, ValueError) as problem:
            raise SkinCalibError(
                f"cannot read {device} with {baud} baud: {problem}. Check its name and permissions"
            ) from problem
        self._decoder, self.text = decoder, f"{device}, {baud} baud"

    def read(self) -> list[Reading]:
        """Return the readings of the bytes that have arrived."""
        try:
            data = self._port.read(max(self._port.in_waiting, 1))
        except (self._problem, OSError) as problem:
            raise SkinCalibError(f"{self.text}: {problem}. Check the cable, and start again") from problem
        return self._decoder.feed(data, False) if data else []

    def close(self) -> None:
        """Release the device."""
        self._port.close()


class FileInput(Input):
    """Play a recording at its own speed."""

    def __init__(self, path: Path, skin: Skin):
        recording = read_recording(path, skin)
        self.notes = recording.notes
        frames = recording.by_quantity()
        cycles = recording.cycles or range(len(frames))
        self._left = [Reading(at, cycle, values) for (at, values), cycle in zip(frames, cycles)][::-1]
        self._offset: float | None = None  # of its clock
        self.text = f"{path}, {len(frames)} readings"

    def read(self) -> list[Reading] | None:
        """Return the next reading when it is due."""
        if not self._left:
            return None
        at, now = self._left[-1].time, time.monotonic()
        if self._offset is None or at - self._offset > now + MAX_PAUSE:
            self._offset = at - now
        wait = at - self._offset - now
        if wait > 0:
            time.sleep(min(wait, WAIT))
            if wait > WAIT:
                return []
        return [self._left.pop()]
