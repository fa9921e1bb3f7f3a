"""Contacts keep their number from cycle to cycle."""

import numpy as np
from numpy.testing import assert_array_equal

from tests.soles import field_patch, skin_of

ROWS, COLUMNS = 6, 20


def field():
    return skin_of(field_patch(ROWS, COLUMNS))


def press(*cells):
    """Return a reading with 1 N on some cells."""
    reading = np.zeros((ROWS, COLUMNS))
    for row, column in cells:
        reading[row, column] = 1.0
    return reading.ravel()


def numbers(skin, *frames):
    """Return the numbers of the contacts of each frame."""
    return [[c.number for c in skin.update(press(*cells), 0.01 * k).contacts] for k, cells in enumerate(frames)]


def test_contact_that_slides_keeps_its_number():
    """This includes frames that have no common cell but adjacent cells. A contact that appears gets a new number."""
    assert numbers(field(), [(1, 1), (1, 2)], [(1, 2), (1, 3)], [(1, 4)], [(1, 4), (4, 9)]) == [[1], [1], [1], [1, 2]]


def test_contact_that_jumps_gets_a_new_number():
    """A contact that moves by more than a cell gets a new number; numbers are never used twice."""
    assert numbers(field(), [(1, 1)], [(1, 4)], [(1, 1)], [], [(1, 1)]) == [[1], [2], [3], [], [4]]


def test_larger_part_of_a_split_contact_keeps_the_number():
    """The other part gets a new number."""
    whole = [(2, c) for c in range(1, 8)]
    assert numbers(field(), whole, [(2, 1), *((2, c) for c in range(3, 8))]) == [[1], [2, 1]]


def test_merged_contact_has_the_number_of_the_larger_one():
    """Of two equal contacts the older one gives its number."""
    small, large, bridge = [(2, 1)], [(2, c) for c in range(3, 8)], [(2, 2)]
    assert numbers(field(), small, small + large, small + bridge + large) == [[1], [1, 2], [2]]
    assert numbers(field(), [(2, 1)], [(2, 1), (2, 3)], [(2, 1), (2, 2), (2, 3)]) == [[1], [1, 2], [1]]


def test_two_contacts_do_not_swap_numbers():
    """Each of two adjacent contacts moves over a cell that was next to the other one."""
    assert numbers(field(), [(1, 1), (4, 1)], [(1, 2), (4, 2)], [(2, 2), (4, 3)])[2] == [1, 2]


def test_numbers_do_not_depend_on_frames_that_repeat():
    """Repeated frames with the same cells have the same contacts."""
    skin = field()
    first = numbers(skin, [(1, 1), (1, 2)], [(1, 1), (1, 2)], [(1, 1), (1, 2), (3, 3)], [(1, 1), (1, 2), (3, 3)])
    assert_array_equal(first[2], first[3])
    assert first[:2] == [[1], [1]]
