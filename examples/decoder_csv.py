"""Decoder of lines of numbers: time in milliseconds, counter of the readings, then all channels.

skin-calib run CALIBRATION --input serial:/dev/ttyACM0:921600 --output dds --decoder examples/decoder_csv.py
"""

import numpy as np

from skin_calib_addon.messages.packet import Reading

CHANNELS = 120  # lines with another number of readings are damaged


class Decoder:
    """Find complete lines, and count what is wrong. A line has no checksum: changed digits are not found."""

    def __init__(self):
        self.damaged, self.skipped, self._bytes = 0, 0, None

    def feed(self, data, is_datagram):
        """Return the readings that are complete after these bytes."""
        if is_datagram:
            lines = data.splitlines()
        elif self._bytes is None:  # the first line of a serial line may have begun before
            before, newline, after = data.partition(b"\n")
            self.skipped += len(before)
            self._bytes = after if newline else None
            return self.feed(b"", False) if newline else []
        else:
            *lines, self._bytes = (self._bytes + data).split(b"\n")
        readings = []
        for line in filter(None, map(bytes.strip, lines)):
            try:
                time, cycle, *values = map(int, line.split(b","))
            except ValueError:
                values = []
            if len(values) == CHANNELS:
                readings.append(Reading(time / 1e3, cycle, np.array(values)))
            else:
                self.damaged += 1
        return readings
