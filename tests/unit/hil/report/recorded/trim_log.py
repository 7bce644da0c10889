"""How the log of the run `px4-firmware` was made: what the report reads of PX4's own log, around the attempt.

    perch-hil run simple-i --seed 1 --rig px4-firmware --camera model --out runs
    python tests/unit/hil/report/trim_run.py runs/<run> tests/data/runs/px4-firmware
    python tests/unit/hil/report/recorded/trim_log.py runs/<run> tests/data/runs/px4-firmware/firmware.ulg

The log keeps its parameters, its events with their metadata and the first instance of each topic; samples of slow
signals are thinned to 20 Hz.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from pyulog.core import ULog

from hil.report.recorded.flight import load
from hil.report.recorded.ulog import TOPICS

BEFORE_S = 2.0
FAST = ("vehicle_angular_velocity", "vehicle_rates_setpoint", "actuator_motors", "event")
KEPT = ("ver_sw", "ver_sw_release", "sys_name", "ver_hw", "metadata_events", "metadata_events_sha256")


def trim(run: Path, target: Path) -> None:
    """Write the short form of the log in `run`."""
    recorded = load(run)
    assert recorded.log is not None and recorded.log_clock is not None and recorded.attempt_ns is not None
    log = ULog(str(recorded.log.path), list(TOPICS))
    log._data_list = [
        d for d in log.data_list if d.multi_id == min(o.multi_id for o in log.data_list if o.name == d.name)
    ]
    for one in log.data_list:
        us = one.data["timestamp"].astype(np.int64)
        keep = recorded.seconds(recorded.log_clock.run_ns(us)) > -BEFORE_S
        if one.name not in FAST:
            keep &= np.diff(us // 50_000, prepend=-1) > 0
        one.data = {name: column[keep] for name, column in one.data.items()}
    log._data_list = [one for one in log.data_list if len(one.data["timestamp"])]
    log._message_formats = {one.name: log.message_formats[one.name] for one in log.data_list}
    log._msg_info_dict = {name: value for name, value in log.msg_info_dict.items() if name in KEPT}
    log._msg_info_multiple_dict = {n: value for n, value in log.msg_info_multiple_dict.items() if n in KEPT}
    log.write_ulog(str(target))


if __name__ == "__main__":
    trim(Path(sys.argv[1]), Path(sys.argv[2]))
