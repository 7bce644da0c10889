"""The software PX4 on UDP as an autopilot on the ground station's link, with a few logs to serve."""

LIMIT_S = 60.0
LOGS = {1: b"older" * 100, 2: bytes(range(256)) * 40}


def link(px4):
    return f"udp://127.0.0.1:{px4.port}"
