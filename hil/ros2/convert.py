"""Messages of the contract as ROS 2 messages, by the conventions of REP 103 and REP 105.

Frames: `world` (ENU), `vehicle` (FLU), `board` (x up-slope, z the normal), `camera` (optical). A twist is expressed in
the body's own frame, as nav_msgs/Odometry wants it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hil.contract import messages as m
from hil.recording.foxglove import belief_orientation
from hil.ros2.tags import detection_array
from hil.ros2.types import (
    Ros,
    header,
    pose,
    pose_with_covariance,
    ros,
    time,
    twist,
    twist_with_covariance,
    vector,
)
from kernel.rotations import rotate_back

WORLD, VEHICLE, BOARD, CAR, CAMERA = "world", "vehicle", "board", "car", "camera"
_LEVELS = {"info": 20, "warning": 30, "error": 40}  # rcl_interfaces/Log
_HEADING, _INCLINATION = 3, 6  # in Belief.variance


class Converter:
    """Turns messages of the contract into ROS messages.

    `zero_ns`: the time since 1970 of 0 ns of the run's clock, added to every stamp. `raw`: the pictures are recorded
    whole, so that tags are told in their pixels.
    """

    def __init__(self, zero_ns: int, raw: bool) -> None:
        self._zero_ns, self._raw = zero_ns, raw
        self._stage = ""
        self._of: dict[str, Callable[[str, Any], list[Ros]]] = {
            "truth/vehicle": self._vehicle, "mocap/vehicle": self._vehicle, "vehicle/odometry": self._vehicle,
            "truth/board": self._board, "mocap/board": self._board, "belief": self._belief,
            "board/detection": self._detection, "camera/image": self._image, "policy/action": self._command,
            "vehicle/sent": self._command, "vehicle/status": self._status, "car/command": self._car,
            "car/sent": self._car, "car/feedback": self._car, "car/reference": self._reference,
            "run/stage": self._run_stage, "event": self._event,
        }  # fmt: skip

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of the contract that are converted."""
        return tuple(self._of)

    def __call__(self, topic: str, message: Any) -> list[Ros]:
        """The ROS messages of `message`; none if there is nothing to say."""
        convert = self._of.get(topic)
        return [] if convert is None else convert(f"/{topic}", message)

    def _header(self, message: Any, frame: str) -> Any:
        return header(self._zero_ns + message.stamp_ns, frame)

    def _vehicle(self, name: str, state: m.VehicleState) -> list[Ros]:
        own = rotate_back(state.orientation, *state.velocity)
        return [self._odometry(name, state, VEHICLE, own, state.body_rate)]

    def _board(self, name: str, state: m.BoardState) -> list[Ros]:
        own = rotate_back(state.orientation, *state.velocity)
        turning = rotate_back(state.orientation, 0.0, 0.0, state.turn_rate)
        return [self._odometry(name, state, BOARD, own, turning)]

    def _odometry(self, name: str, state: Any, frame: str, velocity: m.Vec3, rate: m.Vec3) -> Ros:
        return ros(
            name, "nav_msgs/Odometry", header=self._header(state, WORLD), child_frame_id=frame,
            pose=pose_with_covariance(state.position, state.orientation), twist=twist_with_covariance(velocity, rate),
        )  # fmt: skip

    def _belief(self, name: str, belief: m.Belief) -> list[Ros]:
        rho = ros(f"{name}/rho", "std_msgs/Float64", data=float(belief.rho))
        if not belief.valid:
            return [rho]
        head = self._header(belief, WORLD)
        orientation = belief_orientation(belief.heading, belief.inclination)
        c, s = np.cos(belief.heading), np.sin(belief.heading)
        covariance = np.zeros((6, 6))  # unknown, if the belief does not tell it
        if len(belief.variance) > _INCLINATION:
            covariance = np.diag(np.array([*belief.variance[:3], 0.0, 0.0, belief.variance[_HEADING]]))
            axis = np.array([-s, c])  # the horizontal axis that the inclination turns about
            covariance[3:5, 3:5] = belief.variance[_INCLINATION] * np.outer(axis, axis)
        moving, turning = (belief.speed * c, belief.speed * s, 0.0), (0.0, 0.0, belief.turn_rate)
        return [
            rho,
            ros(
                f"{name}/pose", "geometry_msgs/PoseWithCovarianceStamped", header=head,
                pose=pose_with_covariance(belief.position, orientation, covariance),
            ),
            ros(f"{name}/twist", "geometry_msgs/TwistStamped", header=head, twist=twist(moving, turning)),
        ]  # fmt: skip

    def _detection(self, name: str, seen: m.Detection) -> list[Ros]:
        found = []
        if seen.found:
            place, turn = [seen.position_sigma**2] * 3, [seen.orientation_sigma**2] * 3
            whole = pose_with_covariance(seen.position, seen.orientation, np.diag([*place, *turn]))
            head = self._header(seen, WORLD)
            found.append(ros(name, "geometry_msgs/PoseWithCovarianceStamped", header=head, pose=whole))
        if self._raw:
            corners = np.array(seen.corners_px, dtype=float).reshape(-1, 4, 2)
            found.append(detection_array(self._header(seen, CAMERA), seen.tag_ids, corners))
        return found

    def _image(self, _: str, image: m.Image) -> list[Ros]:
        return [
            ros(
                "/camera/image_raw", "sensor_msgs/Image", header=self._header(image, CAMERA), height=image.height,
                width=image.width, encoding="mono8", is_bigendian=0, step=image.width,
                data=np.frombuffer(image.data, np.uint8),
            )
        ]  # fmt: skip

    def _command(self, name: str, command: m.Action | m.Sent) -> list[Ros]:
        head = self._header(command, VEHICLE)
        thrust = (0.0, 0.0, command.thrust)
        return [
            ros(f"{name}/body_rate", "geometry_msgs/Vector3Stamped", header=head, vector=vector(command.body_rate)),
            ros(f"{name}/thrust", "geometry_msgs/Vector3Stamped", header=head, vector=vector(thrust)),
        ]

    def _status(self, _: str, status: m.VehicleStatus) -> list[Ros]:
        nan, none = float("nan"), np.zeros(0, np.float32)
        return [
            ros(
                "/vehicle/battery", "sensor_msgs/BatteryState", header=self._header(status, VEHICLE),
                voltage=float(status.battery_v), temperature=nan, current=nan, charge=nan, capacity=nan,
                design_capacity=nan, percentage=nan, power_supply_status=0, power_supply_health=0,
                power_supply_technology=0, present=True, cell_voltage=none, cell_temperature=none, location="",
                serial_number="",
            )
        ]  # fmt: skip

    def _car(self, name: str, car: m.CarCommand | m.CarFeedback) -> list[Ros]:
        moving = twist((car.speed, 0.0, 0.0), (0.0, 0.0, car.turn_rate))
        return [ros(name, "geometry_msgs/TwistStamped", header=self._header(car, CAR), twist=moving)]

    def _reference(self, name: str, wanted: m.CarReference) -> list[Ros]:
        there = pose((wanted.x, wanted.y, 0.0), belief_orientation(wanted.heading, 0.0))
        return [ros(name, "geometry_msgs/PoseStamped", header=self._header(wanted, WORLD), pose=there)]

    def _run_stage(self, name: str, stage: m.Stage) -> list[Ros]:
        if stage.name == self._stage:
            return []
        self._stage = stage.name
        return [ros(name, "std_msgs/String", data=stage.name)]

    def _event(self, _: str, event: m.Event) -> list[Ros]:
        return [
            ros(
                "/rosout", "rcl_interfaces/Log", stamp=time(self._zero_ns + event.stamp_ns),
                level=_LEVELS.get(event.severity, 20), name=event.source, msg=event.text, file="", function="", line=0,
            )
        ]  # fmt: skip
