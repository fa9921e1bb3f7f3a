"""Packets of the electronics: format, faults of the line; each fault is counted, and no wrong row is returned."""

import struct
import zlib

import numpy as np
import pytest

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.messages.packet import START, Decoder, packet


def counts(decoder):
    """Return all counters."""
    return {
        name: getattr(decoder, name) for name in ("received", "lost", "old", "damaged", "skipped", "restarts")
    }  # fmt: skip


def numbers(**changes):
    """Return what the counters should be."""
    return {"received": 0, "lost": 0, "old": 0, "damaged": 0, "skipped": 0, "restarts": 0} | changes


def stream(cycles, bits=12, channels=7, session=0):
    """Return rows by their cycles, and their packets."""
    rng = np.random.default_rng(4)
    rows = {c: rng.integers(0, 1 << bits, channels) for c in cycles}
    return rows, [packet(row, c, 1000 * c, bits, session) for c, row in rows.items()]


def test_bytes_are_those_of_the_documentation():
    """Written by hand from the table of the page: a change of these bytes is a change of the format."""
    header = b"SKIN" + bytes((1, 12)) + struct.pack("<HIIQ", 3, 7, 258, 1_500_000)
    header += struct.pack("<I", zlib.crc32(header))
    body = bytes((0x23, 0x61, 0x45, 0x89, 0x07))  # 0x123, 0x456, 0x789: low 8 bits, 4 and 4 bits, high 8 bits
    data = header + body + struct.pack("<I", zlib.crc32(header + body))
    assert packet([0x123, 0x456, 0x789], 258, 1_500_000, 12, 7) == data and len(header) == START == 28
    (reading,) = Decoder().feed(data)
    assert reading.values.tolist() == [0x123, 0x456, 0x789] and reading.time == 1.5
    assert packet([1, 2], 0, 0, 16)[START:-4] == b"\1\0\2\0" and packet([1, 2], 0, 0, 8)[START:-4] == b"\1\2"


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("channels", [0, 1, 2, 5, 1260])
def test_readings_come_back(bits, channels):
    """All numbers of bits, even and odd numbers of channels; the ends of the range."""
    row = np.random.default_rng(channels).integers(0, 1 << bits, channels)
    row[:1], row[1:2] = (1 << bits) - 1, 0
    decoder = Decoder()
    (reading,) = decoder.feed(packet(row, 5, 2_000_001, bits), is_datagram=True)
    assert reading.values.tolist() == row.tolist() and reading.values.dtype.kind == "u"
    assert reading.time == 2.000001 and counts(decoder) == numbers(received=1)


@pytest.mark.parametrize("size", [1, 3, 29, 64, 10_000])
def test_serial_bytes_are_joined(size):
    """Any pieces of the stream give all readings, also with garbage before, between and after them."""
    rows, packets = stream(range(50))
    data = b"SKI\0" + b"".join(packets[:20]) + b"noise SKIN noise" + b"".join(packets[20:]) + b"SK"
    decoder = Decoder()
    found = [r for at in range(0, len(data), size) for r in decoder.feed(data[at : at + size])]
    assert [r.values.tolist() for r in found] == [row.tolist() for row in rows.values()]
    assert counts(decoder) == numbers(received=50, skipped=20)


@pytest.mark.parametrize("cut", range(1, 42, 3))
def test_truncated_packet_is_counted_and_the_next_one_found(cut):
    """In a stream its bytes run into the next packet, which is not lost; a datagram ends with it."""
    rows, packets = stream(range(4))
    packets[1] = packets[1][:cut]
    for is_datagram in (False, True):
        decoder = Decoder()
        found = [r for data in packets for r in decoder.feed(data, is_datagram)]
        assert [r.values.tolist() for r in found] == [rows[k].tolist() for k in (0, 2, 3)]
        assert [r.cycle for r in found] == [0, 2, 3]
        fault = {"damaged": 1} if cut >= START else {"skipped": cut}
        counted = counts(decoder)
        if not is_datagram and cut >= START:  # what was left of its readings belongs to no packet
            assert counted.pop("skipped") == cut - START
            counted["skipped"] = 0
        assert counted == numbers(received=3, lost=1, **fault)


def test_lost_repeated_and_late_packets_are_counted():
    """Cycles show which are missing; those that come again or too late are not returned."""
    rows, packets = stream(range(10))
    order = (0, 1, 1, 4, 3, 5, 5, 9)
    decoder = Decoder()
    found = [r for k in order for r in decoder.feed(packets[k], is_datagram=True)]
    assert [r.cycle for r in found] == [0, 1, 4, 5, 9]
    assert [r.values.tolist() for r in found] == [rows[k].tolist() for k in (0, 1, 4, 5, 9)]
    assert counts(decoder) == numbers(received=5, lost=2 + 3, old=3)


def test_restart_of_the_sender_is_counted():
    """A new session begins with any cycle; the cycles that are returned go on."""
    _, first = stream(range(100, 103))
    _, second = stream(range(3), session=9)
    decoder = Decoder()
    found = decoder.feed(b"".join(first + second))
    assert [r.cycle for r in found] == [0, 1, 2, 3, 4, 5] and counts(decoder) == numbers(received=6, restarts=1)


def test_sender_that_restarts_with_the_same_session_is_found():
    """Its cycles begin again; after as many old packets in a row as no network delays, they count as new ones."""
    rows, packets = stream(range(1000))
    decoder = Decoder()
    found = decoder.feed(b"".join(packets[:800] + packets[:300]))
    assert [r.cycle for r in found] == list(range(1001))
    assert [r.values.tolist() for r in found[800:]] == [rows[k].tolist() for k in range(99, 300)]
    assert counts(decoder) == numbers(received=1001, old=99, restarts=1)


def test_late_packets_between_new_ones_are_no_restart():
    """Each packet comes a second time, 200 later."""
    _, packets = stream(range(1000))
    decoder = Decoder()
    for k in range(200, 1000):
        decoder.feed(packets[k] + packets[k - 200])
    assert counts(decoder) == numbers(received=800, old=800)


def test_counter_of_cycles_wraps():
    """After 2^32 readings it begins again, within a session."""
    decoder = Decoder()
    found = [r for c in (2**32 - 2, 2**32 - 1, 0, 3) for r in decoder.feed(packet([1], c, 0))]
    assert [r.cycle for r in found] == [0, 1, 2, 5] and counts(decoder) == numbers(received=4, lost=2)


@pytest.mark.parametrize("is_datagram", [False, True])
def test_damaged_bytes_never_give_a_wrong_row(is_datagram):
    """A thousand packets with 1 % lost, and changed, missing and added bytes: each row is one that was sent."""
    rng = np.random.default_rng(8)
    rows, packets = stream(range(1000), 16, 20)
    decoder, found, damaged = Decoder(), [], set()
    for k, data in enumerate(packets):
        fault = rng.random()
        changed, at = bytearray(data), int(rng.integers(len(data)))
        if fault < 0.01:
            damaged.add(k)
            continue
        if fault < 0.03:
            changed[at] ^= int(rng.integers(1, 256))
        elif fault < 0.05:
            del changed[at : at + 3]
        elif fault < 0.07:
            changed[at:at] = rng.bytes(5)
        if bytes(changed) != data:
            damaged.add(k)
        found += decoder.feed(bytes(changed), is_datagram)
    by_cycle = {r.cycle: r.values.tolist() for r in found}
    assert len(by_cycle) == len(found) and all(row == rows[cycle].tolist() for cycle, row in by_cycle.items())
    assert set(range(1000)) - set(by_cycle) <= damaged and len(damaged) > 50
    assert decoder.received == len(found) and decoder.lost == max(by_cycle) + 1 - len(found)
    assert decoder.damaged + decoder.skipped > 0


def test_garbage_alone_gives_nothing():
    """Also if it has the first bytes of packets; all but the last three bytes are counted."""
    decoder, data = Decoder(), np.random.default_rng(3).bytes(30_000)
    assert decoder.feed(data[:10_000] + b"SKIN" * 500 + data[10_000:]) == []
    assert counts(decoder) == numbers(skipped=32_000 - 3)


def test_unknown_packets_are_refused_by_name():
    """A right header of another version is no garbage."""
    header = b"SKIN" + bytes((2, 16)) + struct.pack("<HIIQ", 1, 0, 0, 0)
    data = header + struct.pack("<I", zlib.crc32(header)) + bytes(6)
    with pytest.raises(CalibrationFormatError, match="version 2 and 16 bits. This program reads version 1"):
        Decoder().feed(data)


@pytest.mark.parametrize(("row", "bits"), [([256], 8), ([-1], 16), ([4096], 12), ([0.5], 16), ([1], 10)])
def test_readings_that_do_not_fit_are_refused(row, bits):
    """No number is cut off."""
    with pytest.raises(ValueError, match=f"readings of {bits} bits must be whole numbers"):
        packet(row, 0, 0, bits)
