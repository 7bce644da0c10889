"""Thin ctypes binding of the AprilTag C library that the pyapriltags wheel carries: detector settings and raw results.

pyapriltags' own Detector is not used because it truncates `decode_sharpening` to an int, hides the quad thresholds and
copies every picture. Pixel centres here are at integers (OpenCV); the library's own lie at +0.5.
"""

from __future__ import annotations

import ctypes as ct
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pyapriltags


class _Image(ct.Structure):
    _fields_ = (("width", ct.c_int), ("height", ct.c_int), ("stride", ct.c_int), ("buf", ct.c_void_p))


class _Array(ct.Structure):
    _fields_ = (("el_sz", ct.c_size_t), ("size", ct.c_int), ("alloc", ct.c_int), ("data", ct.c_void_p))


class _Family(ct.Structure):
    _fields_ = (
        ("ncodes", ct.c_uint32),
        ("codes", ct.POINTER(ct.c_uint64)),
        ("width_at_border", ct.c_int),
        ("total_width", ct.c_int),
        ("reversed_border", ct.c_bool),
    )


class _Found(ct.Structure):
    _fields_ = (
        ("family", ct.c_void_p),
        ("id", ct.c_int),
        ("hamming", ct.c_int),
        ("decision_margin", ct.c_float),
        ("H", ct.c_void_p),
        ("c", ct.c_double * 2),
        ("p", ct.c_double * 8),
    )


class _QuadThresholds(ct.Structure):
    _fields_ = (
        ("min_cluster_pixels", ct.c_int),
        ("max_nmaxima", ct.c_int),
        ("critical_rad", ct.c_float),
        ("cos_critical_rad", ct.c_float),
        ("max_line_fit_mse", ct.c_float),
        ("min_white_black_diff", ct.c_int),
        ("deglitch", ct.c_int),
    )


class _Detector(ct.Structure):
    _fields_ = (
        ("nthreads", ct.c_int),
        ("quad_decimate", ct.c_float),
        ("quad_sigma", ct.c_float),
        ("refine_edges", ct.c_bool),
        ("decode_sharpening", ct.c_double),
        ("debug", ct.c_bool),
        ("qtp", _QuadThresholds),
    )


@dataclass(frozen=True, slots=True)
class Tag:
    """One decoded tag. `corners` (4, 2) px, OpenCV pixel convention, in the order bottom left, bottom right, top right,
    top left of the upright tag."""

    id: int
    hamming: int
    decision_margin: float
    corners: np.ndarray


@cache
def _library() -> ct.CDLL:
    suffix = {"linux": ".so", "darwin": ".dylib", "win32": ".dll"}.get(sys.platform, ".so")
    path = Path(pyapriltags.__file__).parent / f"libapriltag{suffix}"
    if not path.exists():
        raise RuntimeError(f"pyapriltags carries no {path.name} at {path.parent}; reinstall pyapriltags")
    library = ct.CDLL(str(path))
    library.apriltag_detector_create.restype = ct.POINTER(_Detector)
    library.apriltag_detector_destroy.argtypes = [ct.POINTER(_Detector)]
    library.apriltag_detector_add_family_bits.argtypes = [ct.POINTER(_Detector), ct.POINTER(_Family), ct.c_int]
    library.apriltag_detector_detect.argtypes = [ct.POINTER(_Detector), ct.POINTER(_Image)]
    library.apriltag_detector_detect.restype = ct.POINTER(_Array)
    library.apriltag_detections_destroy.argtypes = [ct.POINTER(_Array)]
    library.tag36h11_create.restype = ct.POINTER(_Family)
    library.tag36h11_destroy.argtypes = [ct.POINTER(_Family)]
    library.tag36h11_destroy.restype = None
    return library


class TagDetector:
    """The library's detector for one family, one thread. Not safe to share between threads."""

    def __init__(self, decode_sharpening: float = 0.25) -> None:
        self._lib = _library()
        self._detector = self._lib.apriltag_detector_create()
        settings = self._detector.contents
        if settings.qtp.min_cluster_pixels != 5 or settings.qtp.min_white_black_diff != 5:
            raise RuntimeError("this pyapriltags wheel has another detector layout; install pyapriltags 3.4.3.1")
        # A family of its own: destroying a detector frees the decode table of its family
        self._family = self._lib.tag36h11_create()
        self._lib.apriltag_detector_add_family_bits(self._detector, self._family, 2)
        settings.nthreads = 1
        settings.refine_edges = True
        settings.decode_sharpening = decode_sharpening

    def __del__(self) -> None:
        if getattr(self, "_detector", None):
            self._lib.apriltag_detector_destroy(self._detector)
        if getattr(self, "_family", None):
            self._lib.tag36h11_destroy(self._family)

    def detect(self, image: np.ndarray, decimate: float = 1.0, min_white_black_diff: int = 30) -> list[Tag]:
        """Tags in a uint8 picture (rows may be strided: a crop costs no copy). Order is the library's.

        Quads are looked for at 1/`decimate` of the resolution, on edges of at least `min_white_black_diff` DN. Raises
        ValueError for another kind of picture.
        """
        if image.dtype != np.uint8 or image.ndim != 2 or image.strides[1] != 1:
            raise ValueError(f"a mono uint8 picture with contiguous rows is needed, not {image.dtype} {image.shape}")
        view = _Image(image.shape[1], image.shape[0], image.strides[0], image.ctypes.data)
        self._detector.contents.quad_decimate = decimate
        self._detector.contents.qtp.min_white_black_diff = min_white_black_diff
        found = self._lib.apriltag_detector_detect(self._detector, ct.byref(view))
        tags = []
        pointers = ct.cast(found.contents.data, ct.POINTER(ct.POINTER(_Found)))
        for i in range(found.contents.size):
            one = pointers[i].contents
            corners = np.array(one.p, dtype=np.float64).reshape(4, 2) - 0.5
            tags.append(Tag(one.id, one.hamming, one.decision_margin, corners))
        self._lib.apriltag_detections_destroy(found)
        return tags
