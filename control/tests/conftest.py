"""The settings of the repository's tests: profiles of Hypothesis, and warnings of arithmetic as errors."""

from tests.conftest import pytest_configure  # noqa: F401  its module registers the profiles
