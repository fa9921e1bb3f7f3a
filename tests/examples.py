"""How much of a costly test a run takes: the number of examples of a property, the cases for the full suite only."""

import pytest
from hypothesis import settings

FULL = 40  # examples of a test in the profile "full"; the counts that tests ask for are those of this profile


def examples(count):
    """Settings that draw ``count`` examples in the profile "full" and in proportion in the others, at least two."""
    return settings(max_examples=max(2, round(count * settings.default.max_examples / FULL)))


def slow(*values, **options):
    """A case of a parametrized test that "make test" leaves out."""
    return pytest.param(*values, marks=pytest.mark.slow, **options)
