"""Where tests find the project and their data."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "tests" / "data"
PX4_DATA = DATA / "px4"
GOLDEN_RUN = DATA / "runs" / "simple-ii"
FIRMWARE_RUN = DATA / "runs" / "px4-firmware"  # flown by a real PX4, whose own log lies in the folder
