"""Packets of readings from the electronics, over UDP or a serial line: encode them, find them in bytes, count faults.

The page "Packets" of the documentation has the format. A decoder for other electronics has the method ``feed``, too.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from ..common.arrays import Array
from ..common.errors import CalibrationFormatError

MAGIC, VERSION = b"SKIN", 1  # Contract
# Contract: magic, version, bits, channels, session, cycle, time [us]; then the CRC-32 of these
HEADER = struct.Struct("<4sBBHIIQ")
CRC = struct.Struct("<I")
BITS = (8, 12, 16)  # Contract: of a reading
# Packets in a row that are older than the last reading, in their order, from which on they are those of a sender that
# has started again with the same session. Larger: more readings of such a sender are not used; smaller: late packets
# that come a second time count as new.
OLD_IN_A_ROW = 100
START = HEADER.size + CRC.size  # Derived: bytes before the readings


@dataclass(frozen=True, eq=False)
class Reading:
    """One reading of all channels."""

    time: float  # on the clock of the sender [s]
    cycle: int  # number since the start of the decoder; lost readings and restarts of the sender count
    values: Array | Mapping[str, Array]  # (channels,) as the electronics send them; or these by their quantities


def packet(values: Any, cycle: int, time_us: int, bits: int = 16, session: int = 0) -> bytes:
    """Return the packet of a reading (channels,) of whole numbers; one that does not fit raises ValueError."""
    numbers = np.asarray(values)
    if bits not in BITS or numbers.dtype.kind not in "ui" or ((numbers < 0) | (numbers >= 1 << bits)).any():
        raise ValueError(f"readings of {bits} bits must be whole numbers from 0 to {(1 << bits) - 1}")
    header = HEADER.pack(MAGIC, VERSION, bits, len(numbers), session, cycle % 2**32, time_us)
    header += CRC.pack(crc32(header))
    body = _packed(numbers, bits)
    return header + body + CRC.pack(crc32(header + body))


def _packed(numbers: Array, bits: int) -> bytes:
    if bits != 12:
        return numbers.astype("<u1" if bits == 8 else "<u2").tobytes()
    first, second = np.append(numbers, np.zeros(len(numbers) % 2, numbers.dtype)).astype("<u2").reshape(-1, 2).T
    triples = np.stack((first & 255, first >> 8 | (second & 15) << 4, second >> 4), axis=1)
    return triples.astype("u1").tobytes()[: _size(len(numbers), 12)]


def _size(channels: int, bits: int) -> int:
    """Return the number of bytes of the readings."""
    return (channels * bits + 7) // 8


def _unpacked(body: bytes, channels: int, bits: int) -> Array:
    if bits != 12:
        return np.frombuffer(body, "<u1" if bits == 8 else "<u2")
    low, middle, high = np.frombuffer(body + bytes(-len(body) % 3), "u1").reshape(-1, 3).astype(np.uint16).T
    return np.stack((low | (middle & 15) << 8, middle >> 4 | high << 4), axis=1).ravel()[:channels]


class Decoder:
    """Find packets in bytes that may be cut, damaged, repeated or mixed with others, and count what is wrong.

    A reading is returned only if both of its checksums are right, and once. Readings are in the order of their cycles.
    """

    def __init__(self) -> None:
        self.received = 0  # readings that were returned
        self.lost = 0  # readings that are missing between them, by their cycles
        self.old = 0  # packets that came again, or after a later one; they are not returned
        self.damaged = 0  # packets with a right header, and wrong or missing readings
        self.skipped = 0  # bytes that belong to no packet with a right header
        self.restarts = 0  # changes of the session, and cycles that begin again: the sender has started again
        self._buffer = bytearray()
        self._session: int | None = None
        self._last = 0  # cycle of the sender
        self._cycle = 0  # of the last reading
        self._old_cycle = self._olds = 0  # of the last old packet, and how many there were in a row

    def feed(self, data: bytes, is_datagram: bool = False) -> list[Reading]:
        """Return the readings that are complete after these bytes; a datagram ends with its packet.

        A packet of an unknown version or number of bits raises a CalibrationFormatError.
        """
        buffer, readings = self._buffer, []
        buffer += data
        while len(buffer) >= START:
            start = buffer.find(MAGIC)
            if start != 0:  # without a magic, its first bytes may be at the end
                self._skip(start if start > 0 else len(buffer) - len(MAGIC) + 1)
                continue
            if crc32(buffer[: HEADER.size]) != CRC.unpack_from(buffer, HEADER.size)[0]:
                self._skip(1)
                continue
            _, version, bits, channels, session, cycle, time = HEADER.unpack_from(buffer)
            if version != VERSION or bits not in BITS:
                known = f"This program reads version {VERSION} and {BITS} bits"
                raise CalibrationFormatError(f"a packet has version {version} and {bits} bits. {known}")
            end = START + _size(channels, bits)
            if len(buffer) < end + CRC.size:
                break
            if crc32(buffer[:end]) != CRC.unpack_from(buffer, end)[0]:
                self.damaged += 1
                del buffer[:START]  # another packet can begin in what follows
                continue
            if self._is_next(session, cycle):
                values = _unpacked(bytes(buffer[START:end]), channels, bits)
                readings.append(Reading(time / 1e6, self._cycle, values))
            del buffer[: end + CRC.size]
        if is_datagram and buffer:
            is_cut = len(buffer) >= START and buffer.startswith(MAGIC)
            self.damaged += is_cut
            self.skipped += 0 if is_cut else len(buffer)
            buffer.clear()
        return readings

    def _skip(self, count: int) -> None:
        self.skipped += count
        del self._buffer[:count]

    def _is_next(self, session: int, cycle: int) -> bool:
        """Count a packet; return whether it is later than the last one."""
        if session != self._session:
            self.restarts += self._session is not None
            self._cycle += self._session is not None
        else:
            step = (cycle - self._last) % 2**32
            if step == 0 or step >= 2**31:  # the counter wraps
                is_later = 0 < (cycle - self._old_cycle) % 2**32 < 2**31
                self._old_cycle, self._olds = cycle, self._olds + 1 if is_later else 1
                if self._olds < OLD_IN_A_ROW:
                    self.old += 1
                    return False
                self.restarts, step = self.restarts + 1, 1
            self.lost += step - 1
            self._cycle += step
        self._session, self._last, self._olds = session, cycle, 0
        self.received += 1
        return True
