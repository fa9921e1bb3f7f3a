"""Settings of all tests: no clock decides, and arithmetic that goes wrong is an error, not a warning."""

import os

from hypothesis import settings

settings.register_profile("quick", deadline=None, max_examples=40)
settings.register_profile("thorough", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


def pytest_configure(config):
    """A user would see such a warning on stderr, where one line is promised."""
    config.addinivalue_line("filterwarnings", "error::RuntimeWarning")
