"""The golden run, and broken copies of it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.paths import GOLDEN_RUN as GOLDEN


@pytest.fixture(scope="session")
def golden() -> Path:
    """A short run of the real loop that perched; see trim_run.py."""
    return GOLDEN


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """A copy of the golden run that a test may break."""
    return Path(shutil.copytree(GOLDEN, tmp_path / "20260102T030405Z_simple-ii_sim-seed3"))
