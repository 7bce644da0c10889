"""Mission, geofence and rally points as PX4 stores them, which items it takes, and how far the mission has come."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from vehicle.px4.protocol import Command as Cmd
from vehicle.px4.protocol import MissionResult, mavlink

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255  # MAV_MISSION_TYPE
MOST = {MISSION: 2000, FENCE: 64, RALLY: 32}  # items
FRAME_MISSION = 2  # of an item without a place
_ABSOLUTE, _RELATIVE = {0: 5, 5: 5}, {3: 6, 6: 6}  # MAV_FRAME as received -> as PX4 gives it back
_VERTICES = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)  # fmt: skip
_OF_FENCE = (
    *_VERTICES, mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
)  # fmt: skip
_OF_RALLY = (mavlink.MAV_CMD_NAV_RALLY_POINT,)
AT_PLACE = (
    Cmd.NAV_WAYPOINT, Cmd.NAV_LOITER_UNLIM, Cmd.NAV_LOITER_TIME, Cmd.NAV_LAND, Cmd.NAV_TAKEOFF, Cmd.NAV_LOITER_TO_ALT,
)  # fmt: skip
_WITH_PLACE = (
    *AT_PLACE, *_OF_FENCE, *_OF_RALLY, mavlink.MAV_CMD_NAV_ROI, mavlink.MAV_CMD_DO_SET_ROI,
    mavlink.MAV_CMD_DO_SET_ROI_LOCATION, mavlink.MAV_CMD_CONDITION_GATE, mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    mavlink.MAV_CMD_DO_AUTOTUNE_ENABLE, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_LAND,
)  # fmt: skip
_WITHOUT_PLACE = (
    Cmd.DO_JUMP, Cmd.DO_CHANGE_SPEED, Cmd.NAV_DELAY, Cmd.NAV_RETURN_TO_LAUNCH, mavlink.MAV_CMD_NAV_ROI,
    mavlink.MAV_CMD_DO_SET_ROI, mavlink.MAV_CMD_DO_WINCH, mavlink.MAV_CMD_DO_GRIPPER, mavlink.MAV_CMD_DO_SET_HOME,
    mavlink.MAV_CMD_DO_LAND_START, mavlink.MAV_CMD_DO_TRIGGER_CONTROL, mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
    mavlink.MAV_CMD_DO_MOUNT_CONFIGURE, mavlink.MAV_CMD_DO_MOUNT_CONTROL, Cmd.DO_GIMBAL_MANAGER_PITCHYAW,
    Cmd.DO_GIMBAL_MANAGER_CONFIGURE, mavlink.MAV_CMD_SET_CAMERA_FOCUS, mavlink.MAV_CMD_IMAGE_START_CAPTURE,
    mavlink.MAV_CMD_IMAGE_STOP_CAPTURE, mavlink.MAV_CMD_VIDEO_START_CAPTURE, mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
    mavlink.MAV_CMD_DO_CONTROL_VIDEO, mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST, mavlink.MAV_CMD_OBLIQUE_SURVEY,
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL, mavlink.MAV_CMD_SET_CAMERA_MODE, mavlink.MAV_CMD_SET_CAMERA_SOURCE,
    mavlink.MAV_CMD_DO_VTOL_TRANSITION, mavlink.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET, mavlink.MAV_CMD_DO_SET_ROI_NONE,
    mavlink.MAV_CMD_CONDITION_DELAY, mavlink.MAV_CMD_CONDITION_DISTANCE, mavlink.MAV_CMD_DO_SET_ACTUATOR,
    mavlink.MAV_CMD_DO_AUTOTUNE_ENABLE, mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
)  # fmt: skip


class Item(NamedTuple):
    """One item as MISSION_ITEM_INT carries it; `params`: the first four; `x`, `y` in 1e-7 deg where it has a place."""

    frame: int
    command: int
    current: int
    autocontinue: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float

    @property
    def relative(self) -> bool:
        """Whether `z` counts from the home position, not from sea level."""
        return self.frame == 6

    @classmethod
    def read(cls, m: Any, scale: float = 1.0) -> Item:
        """Of the fields of a MISSION_ITEM_INT, or with `scale` 1e7 of a MISSION_ITEM."""
        params = (m.param1, m.param2, m.param3, m.param4)
        scale = scale if m.frame != FRAME_MISSION else 1.0
        x, y = (round(v * scale) if math.isfinite(v) and abs(v * scale) < 2**31 else 0 for v in (m.x, m.y))
        frame = {**_ABSOLUTE, **_RELATIVE}.get(m.frame, m.frame)
        return cls(frame, m.command, m.current, m.autocontinue, params, x, y, m.z)


def complaint(kind: int, item: Item) -> MissionResult:
    """Why PX4 does not take an item of a list of `kind`; ACCEPTED if it does."""
    if item.frame not in (5, 6, FRAME_MISSION):
        return MissionResult.UNSUPPORTED_FRAME
    if item.command not in (_WITHOUT_PLACE if item.frame == FRAME_MISSION else _WITH_PLACE):
        return MissionResult.UNSUPPORTED
    if kind == MISSION and item.command in (*_OF_FENCE, *_OF_RALLY):
        return MissionResult.ERROR
    if kind == FENCE and item.command in _VERTICES and not item.params[0] >= 3:
        return MissionResult.ERROR
    return MissionResult.ACCEPTED


@dataclass
class Plan:
    """`items` by MAV_MISSION_TYPE. `current`: the mission's item that is flown or to be flown; `reached`: the last one
    that was reached, -1: none; `finished`: there is none left. `changes` counts what a client changed of the mission.
    """

    items: dict[int, tuple[Item, ...]] = field(default_factory=lambda: {MISSION: (), FENCE: (), RALLY: ()})
    current: int = 0
    reached: int = -1
    finished: bool = False
    changes: int = 0

    @property
    def mission(self) -> tuple[Item, ...]:
        """The mission's items."""
        return self.items[MISSION]

    def store(self, kind: int, items: tuple[Item, ...]) -> None:
        """Put a list in place of the one of its kind. An equal mission changes nothing, as on PX4."""
        if kind != MISSION or items != self.mission:
            self.items[kind] = items
            if kind == MISSION:
                self.go_to(next((seq for seq, item in enumerate(items) if item.current), 0))
                self.reached = -1

    def go_to(self, seq: int) -> None:
        """The item `seq` is to be flown next."""
        self.current, self.finished = seq, False
        self.changes += 1
