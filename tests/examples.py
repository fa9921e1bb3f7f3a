"""How many examples a property test draws whose single example takes long."""

from hypothesis import settings

FULL = 40  # examples of a test in the profile "full"; the counts that tests ask for are those of this profile


def examples(count):
    """Settings that draw ``count`` examples in the profile "full" and in proportion in the others, at least two."""
    return settings(max_examples=max(2, round(count * settings.default.max_examples / FULL)))
