"""The slow look at an autopilot, over its ground station link: version, health, every parameter. Uses MAVSDK.

For checklists and manifests. It blocks for seconds and has threads of its own: never call it from a control loop.
"""

from __future__ import annotations

import importlib
import threading
from dataclasses import dataclass
from typing import Any


class NoAutopilotError(RuntimeError):
    """Nobody answered, or MAVSDK is not there; the text says what to look at."""


@dataclass(frozen=True)
class Inspection:
    """What an autopilot says of itself. `parameters`: name: value (INT32 as int); `health`: aspect: fine or not."""

    system: int
    version: str
    armed: bool
    health: dict[str, bool]
    parameters: dict[str, float | int]

    @property
    def armable(self) -> bool:
        """True if the pre-arm checks pass."""
        return self.health["armable"]


def inspect(url: str = "udpin://0.0.0.0:14550", wait_s: float = 10.0) -> Inspection:
    """Connect, ask, disconnect. `url` is MAVSDK's: udpin://host:port, serial:///dev/ttyACM0:57600, ...

    Raises NoAutopilotError if MAVSDK is not installed, the URL cannot be opened, or no autopilot answers in `wait_s`.
    """
    try:
        mavsdk = importlib.import_module("mavsdk")
        plugins = {name: importlib.import_module(f"mavsdk.plugins.{name}") for name in ("info", "param", "telemetry")}
    except ImportError:
        raise NoAutopilotError("inspecting an autopilot needs the package mavsdk: pip install mavsdk==4.1.0") from None
    client = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION))
    opened: list[Any] = []
    try:
        result = client.add_any_connection(url)
        if result != mavsdk.ConnectionResult.SUCCESS:
            raise NoAutopilotError(
                f"{url} cannot be opened ({result.name}): is the port in use, the device plugged in?"
            )
        system = client.first_autopilot(wait_s)
        if system is None:
            raise NoAutopilotError(f"no autopilot spoke on {url} within {wait_s:g} s: check its link, port and power")
        info, param, telemetry = (
            plugins["info"].Info(system),
            plugins["param"].Param(system),
            plugins["telemetry"].Telemetry(system),
        )
        opened = [info, param, telemetry]
        return Inspection(
            system=system.get_system_id(),
            version=_version(info),
            armed=bool(telemetry.armed()),
            health=_health(telemetry, wait_s),
            parameters=_parameters(param),
        )
    except mavsdk.MavsdkError as error:
        raise NoAutopilotError(f"the autopilot on {url} did not answer: {error}") from None
    finally:
        for plugin in opened:
            plugin.destroy()
        client.destroy()


def _version(info: Any) -> str:
    version = info.get_version()
    return f"{version.flight_sw_major}.{version.flight_sw_minor}.{version.flight_sw_patch}"


def _health(telemetry: Any, wait_s: float) -> dict[str, bool]:
    """Waits for the first report: before it, MAVSDK says everything is ill."""
    arrived = threading.Event()
    seen: list[Any] = []

    def heard(health: Any, _: Any) -> None:
        seen.append(health)
        if health.is_armable or len(seen) > 20:
            arrived.set()

    handle = telemetry.subscribe_health(heard)
    arrived.wait(min(3.0, wait_s))
    telemetry.unsubscribe_health(handle)
    health = seen[-1] if seen else telemetry.health()
    return {name.removeprefix("is_").removesuffix("_ok"): bool(value) for name, value in vars(health).items()}


def _parameters(param: Any) -> dict[str, float | int]:
    everything = param.get_all_params()
    found: dict[str, float | int] = {p.name: int(p.value) for p in everything.int_params}
    found |= {p.name: float(p.value) for p in everything.float_params}
    return dict(sorted(found.items()))
