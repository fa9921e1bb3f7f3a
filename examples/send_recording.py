"""Send a table of readings as packets over UDP, in its own time: what electronics do, or a program that reads them.

python examples/send_recording.py RECORDING.csv PORT
"""

import csv
import socket
import sys
import time

import numpy as np

from skin_calib_addon.messages.packet import packet


def main(path: str, port: int) -> None:
    """Send each row: a time in seconds, and the columns channel_0, channel_1, ... in their order."""
    with open(path, newline="") as file:
        header, *rows = csv.reader(file)
    channels = [header.index(f"channel_{k}") for k in range(sum(name.startswith("channel_") for name in header))]
    session = int(time.time()) % 2**32  # another one after each start
    start, first = time.time(), float(rows[0][0])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for cycle, row in enumerate(rows):
            due = start + float(row[0]) - first
            time.sleep(max(due - time.time(), 0))
            values = np.array([int(row[k]) for k in channels])
            out.sendto(packet(values, cycle, int(due * 1e6), bits=16, session=session), ("127.0.0.1", port))
    print(f"{len(rows)} packets sent")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
