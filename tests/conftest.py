"""Shared by all tests: property tests may take the time of a kernel's first compile, and draw the same examples; one
live run at a time."""

import fcntl
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("reproducible", deadline=None, derandomize=True)
settings.load_profile("reproducible")


@pytest.fixture
def real_time():
    """Waits until no other test of this user has a live run: two at once want four busy cores, and a process that joins
    the bus removes shared memory that it takes for orphaned."""
    with (Path(tempfile.gettempdir()) / f"perch-hil-real-time-{os.getuid()}").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
