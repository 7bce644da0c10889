"""Faults of the camera: of its pictures, or of the model's detections where a run has no pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

import cv2
import numpy as np
from pydantic import Field

from hil.contract.messages import Image
from hil.contract.node import Inbox, Out
from hil.faults.fault import Fault, Milliseconds, Parameters, Share
from kernel.random import uniform

_SEEN = ("camera/image", "board/detection")


class CameraFrozen(Fault):
    """The camera goes on to deliver one picture, with new stamps."""

    kind, nodes = "camera.frozen", ("camera",)
    _held: Any = None

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        if out.topic not in _SEEN:
            return [out]
        self._held = self._held or out.message
        new = out.message
        number = {"sequence": new.sequence} if isinstance(new, Image) else {"image_sequence": new.image_sequence}
        return [out._replace(message=replace(self._held, stamp_ns=new.stamp_ns, **number))]


class CameraDropped(Fault):
    """Pictures are lost on the way."""

    kind, nodes = "camera.dropped", ("camera",)

    class Parameters(Parameters):
        share: Share = 1.0

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        return [] if out.topic in _SEEN and self.chance(self.p.share) else [out]


class CameraLate(Fault):
    """Pictures arrive late, with true stamps."""

    kind, nodes = "camera.late", ("camera",)

    class Parameters(Parameters):
        delay_ms: Milliseconds = 80.0

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        late = out._replace(delay_ns=out.delay_ns + round(self.p.delay_ms * 1e6))
        return [late if out.topic in _SEEN else out]


class CameraStamp(Fault):
    """Pictures carry a stamp that is wrong; positive: later than the exposure."""

    kind, nodes = "camera.stamp", ("camera",)

    class Parameters(Parameters):
        offset_ms: Annotated[float, Field(ge=-60_000, le=60_000)] = -100.0

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        if out.topic not in _SEEN:
            return [out]
        stamp_ns = max(0, out.message.stamp_ns + round(self.p.offset_ms * 1e6))
        return [out._replace(message=replace(out.message, stamp_ns=stamp_ns))]


class _Pictures(Fault):
    """A fault that changes the pixels."""

    nodes, pictures = ("camera",), True

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        if out.topic != "camera/image":
            return [out]
        image: Image = out.message
        pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width)
        return [out._replace(message=replace(image, data=self.changed(pixels).astype(np.uint8).tobytes()))]

    def changed(self, pixels: np.ndarray) -> np.ndarray:
        """The picture (height, width) uint8 as the fault leaves it."""
        raise NotImplementedError


class CameraDark(_Pictures):
    """Pictures are under-exposed."""

    kind = "camera.dark"

    class Parameters(Parameters):
        gain: Annotated[float, Field(ge=0, lt=1)] = 0.05

    def changed(self, pixels: np.ndarray) -> np.ndarray:
        return pixels * self.p.gain


class CameraOverexposed(_Pictures):
    """Pictures are over-exposed."""

    kind = "camera.overexposed"

    class Parameters(Parameters):
        gain: Annotated[float, Field(gt=1, le=100)] = 8.0

    def changed(self, pixels: np.ndarray) -> np.ndarray:
        return np.minimum(pixels * self.p.gain, 255.0)


class CameraBlurred(_Pictures):
    """Pictures are out of focus: blurred over `width` px."""

    kind = "camera.blurred"

    class Parameters(Parameters):
        width: Annotated[int, Field(ge=2, le=200)] = 25

    def changed(self, pixels: np.ndarray) -> np.ndarray:
        return cv2.blur(pixels, (self.p.width, self.p.width))


class _Spots(_Pictures):
    """Discs at random places that stay, until they cover a share of the picture."""

    value = 0

    class Parameters(Parameters):
        share: Share = 0.5

    _mask: np.ndarray | None = None

    def changed(self, pixels: np.ndarray) -> np.ndarray:
        if self._mask is None:
            mask = np.zeros(pixels.shape, np.uint8)
            height, width = pixels.shape
            while mask.mean() < self.p.share:
                x, y = (int(uniform(self.rng, 0.0, size)) for size in (width, height))
                cv2.circle(mask, (x, y), int(uniform(self.rng, 0.03, 0.12) * width), 1, -1)
            self._mask = mask
        return np.where(self._mask, np.uint8(self.value), pixels)


class CameraCovered(_Spots):
    """Dirt covers a share of the picture, and tags behind it."""

    kind = "camera.covered"


class CameraGlare(_Spots):
    """Glare covers a share of the picture, and tags in it."""

    kind, value = "camera.glare", 255


class CameraIntrinsics(_Pictures):
    """The lens is not the calibrated one: its focal length is `focal` times as long."""

    kind = "camera.intrinsics"

    class Parameters(Parameters):
        focal: Annotated[float, Field(ge=0.5, le=2)] = 1.1

    def changed(self, pixels: np.ndarray) -> np.ndarray:
        height, width = pixels.shape
        zoom, x, y = self.p.focal, (width - 1) / 2, (height - 1) / 2
        matrix = np.array([[zoom, 0.0, (1 - zoom) * x], [0.0, zoom, (1 - zoom) * y]])
        return cv2.warpAffine(pixels, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)


KINDS = (
    CameraFrozen, CameraDropped, CameraLate, CameraStamp, CameraDark, CameraOverexposed, CameraBlurred, CameraCovered,
    CameraGlare, CameraIntrinsics,
)  # fmt: skip
