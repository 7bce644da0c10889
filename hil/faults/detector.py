"""Faults of the detector: poses that are wrong in the ways in which tag detectors are."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from hil.contract.messages import Detection, VehicleState
from hil.contract.node import Inbox, Out
from hil.faults.fault import Fault, Parameters, Share
from kernel.random import normal
from kernel.rotations import from_rotation_vector, multiply, normalise, rotate


class _Detections(Fault):
    nodes = ("detector", "camera")

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        if out.topic != "board/detection" or not out.message.found:
            return [out]
        return [out._replace(message=message) for message in self.seen(out.message, inbox)]

    def seen(self, detection: Detection, inbox: Inbox) -> list[Detection]:
        """What is published in place of a detection that found the board."""
        raise NotImplementedError


class DetectorOutlier(_Detections):
    """A share of the poses is off by a random distance (one-sigma m, an axis) and angle."""

    kind = "detector.outlier"

    class Parameters(Parameters):
        share: Share = 0.3
        distance: Annotated[float, Field(ge=0, le=20)] = 0.5
        angle_deg: Annotated[float, Field(ge=0, le=180)] = 30.0

    def seen(self, detection: Detection, inbox: Inbox) -> list[Detection]:
        if not self.chance(self.p.share):
            return [detection]
        x, y, z = (float(p + self.p.distance * normal(self.rng)) for p in detection.position)
        turn = [math.radians(self.p.angle_deg) * float(normal(self.rng)) for _ in range(3)]
        turned = normalise(multiply(detection.orientation, from_rotation_vector(*turn)))
        w, a, b, c = (float(value) for value in turned)
        return [replace(detection, position=(x, y, z), orientation=(w, a, b, c))]


class DetectorMirrored(_Detections):
    """A share of the poses is the wrong one of the two that a flat tag allows: the board's normal mirrored at the line
    of sight."""

    kind = "detector.mirrored"

    class Parameters(Parameters):
        share: Share = 0.5

    def seen(self, detection: Detection, inbox: Inbox) -> list[Detection]:
        topic = next((t for t in ("vehicle/odometry", "truth/vehicle") if _has(inbox, t)), "")
        vehicle: VehicleState | None = inbox.latest(topic) if topic else None
        if vehicle is None or not self.chance(self.p.share):
            return [detection]
        sight = np.array(detection.position) - np.array(vehicle.position)
        sight *= math.pi / max(1e-6, float(np.linalg.norm(sight)))
        # half a turn about the line of sight mirrors the normal; half a turn about the new normal keeps up-slope up
        half = multiply(from_rotation_vector(*sight.tolist()), detection.orientation)
        normal_ = [math.pi * float(v) for v in rotate(half, 0.0, 0.0, 1.0)]
        w, x, y, z = (float(value) for value in normalise(multiply(from_rotation_vector(*normal_), half)))
        return [replace(detection, orientation=(w, x, y, z))]


class DetectorDuplicate(_Detections):
    """A second board is found beside the first one, `distance` m to the east, in each picture."""

    kind = "detector.duplicate"

    class Parameters(Parameters):
        distance: Annotated[float, Field(gt=0, le=20)] = 1.0

    def seen(self, detection: Detection, inbox: Inbox) -> list[Detection]:
        x, y, z = detection.position
        return [detection, replace(detection, position=(x + self.p.distance, y, z))]


def _has(inbox: Inbox, topic: str) -> bool:
    try:
        return inbox.latest(topic) is not None
    except KeyError:
        return False


KINDS = (DetectorOutlier, DetectorMirrored, DetectorDuplicate)
