"""Settings of all tests: no clock decides, and arithmetic that goes wrong is an error, not a warning."""

from hypothesis import settings

settings.register_profile("same", deadline=None, max_examples=40, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("same")


def pytest_configure(config):
    """A user would see such a warning on stderr, where one line is promised."""
    config.addinivalue_line("filterwarnings", "error::RuntimeWarning")
