"""Decoder of the tactile fingers TSF-85 of Robotiq: 28 taxels on each of two fingers, channels 0 to 27 and 28 to 55.

skin-calib run CALIBRATION --input serial:/dev/ttyACM0 --output dds --decoder examples/decoder_robotiq.py

A frame is 0x9A, a byte that the firmware does not use, a command, the length, and values: one byte with kind and
finger, then 16-bit numbers, high byte first. Frames have no number and no checksum: lost ones cannot be counted. A
frame counts as complete if the next one begins where it ends.
"""

import time

import numpy as np

from skin_calib_addon.messages.packet import Reading

# Of each kind: taxels, dynamic, acceleration, rotation, magnetic field, temperature, time.
BYTES = {0x1: 56, 0x2: 2, 0x3: 6, 0x4: 6, 0x5: 6, 0x6: 2, 0x7: 8}
START, TAXELS = 0x9A, 0x1


class Decoder:
    """Join the frames of both fingers to a reading."""

    start = bytes((START, 0, 0x58, 1, 1))  # send all values each millisecond

    def __init__(self):
        self.damaged = self.skipped = self._cycle = 0
        self._bytes, self._fingers = bytearray(), {}

    def feed(self, data, is_datagram):
        """Return the readings that are complete after these bytes."""
        buffer, readings = self._bytes, []
        buffer += data
        while len(buffer) > 3 and len(buffer) > (end := 4 + buffer[3]):
            is_frame = buffer[0] == buffer[end] == START
            found = self._fingers_in(bytes(buffer[4:end])) if is_frame else None
            if found is None:  # another frame can begin in what follows
                self.damaged += buffer[0] == START
                self.skipped += buffer[0] != START
                self._fingers = {}  # fingers of different readings are never joined
                del buffer[0]
                continue
            del buffer[:end]
            self._fingers |= found
            if len(self._fingers) == 2:
                readings.append(Reading(time.time(), self._cycle, np.concatenate([self._fingers[k] for k in (0, 1)])))
                self._cycle, self._fingers = self._cycle + 1, {}
        return readings

    def _fingers_in(self, values):
        """Return the taxels by their finger; None if these are not the values of a frame."""
        found = {}
        while values:
            kind, finger = values[0] >> 4, values[0] >> 2 & 3
            size = BYTES.get(kind, len(values))
            if len(values) <= size or finger > 1:
                return None
            if kind == TAXELS:
                found[finger] = np.frombuffer(values, ">u2", 28, 1).astype(np.uint16)
            values = values[1 + size :]
        return found
