"""Shared by all tests: property tests may take the time of a kernel's first compile, and draw the same examples."""

from hypothesis import settings

settings.register_profile("reproducible", deadline=None, derandomize=True)
settings.load_profile("reproducible")
