"""A MAVSDK client for the tests; importing it skips a test's module where MAVSDK is not installed."""

import time

import pytest

mavsdk = pytest.importorskip("mavsdk", reason="the package mavsdk is not installed")
from mavsdk.plugins import action, offboard, telemetry  # noqa: E402  (it may be missing)

LIMIT_S = 60.0  # for what takes seconds on an idle machine


def wait(condition, what):
    until = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < until, f"no {what} within {LIMIT_S} s"
        time.sleep(0.02)


def persist(call):
    """MAVSDK gives a command up after 1.5 s, which a busy machine may need."""
    until = time.monotonic() + LIMIT_S
    while True:
        try:
            return call()
        except mavsdk.exceptions.MavsdkError as error:
            if error.result.name not in ("TIMEOUT", "BUSY") or time.monotonic() > until:
                raise


class Connection:
    """A MAVSDK client with the plugins of its examples."""

    def __init__(self, url):
        self.client = mavsdk.Mavsdk(
            mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
        )
        self.plugins = []
        try:
            assert self.client.add_any_connection(url) == mavsdk.ConnectionResult.SUCCESS
            self.system = self.client.first_autopilot(LIMIT_S)
            assert self.system is not None, "MAVSDK did not discover the autopilot"
            self.plugins = [kind(self.system) for kind in (action.Action, offboard.Offboard, telemetry.Telemetry)]
        except BaseException:
            self.close()
            raise

    def close(self):
        for plugin in self.plugins:
            plugin.destroy()
        self.client.destroy()
