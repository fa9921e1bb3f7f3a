"""Settings of all tests: no clock decides, and arithmetic that goes wrong is an error, not a warning."""

from hypothesis import settings

from tests.examples import FULL

settings.register_profile("quick", deadline=None, max_examples=12, derandomize=True)
settings.register_profile("full", deadline=None, max_examples=FULL, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("quick")


def pytest_configure(config):
    """A user would see such a warning on stderr, where one line is promised."""
    config.addinivalue_line("filterwarnings", "error::RuntimeWarning")
