"""Rotation kernels: quaternions w, x, y, z (world from body unless a name says otherwise), ENU/FLU <-> NED/FRD.

A quaternion argument is anything indexable of length 4 (array row or tuple); results are tuples, so nothing is
allocated. Vectors go in and out as three scalars for the same reason.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.clip import clip
from kernel.jit import njit

IDENTITY = (1.0, 0.0, 0.0, 0.0)
_R = math.sqrt(0.5)


@njit(inline="always")
def multiply(a, b):
    """Hamilton product a b (4-tuple): rotate by b first, then by a."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@njit(inline="always")
def conjugate(q):
    """The inverse rotation of a unit quaternion (4-tuple)."""
    return q[0], -q[1], -q[2], -q[3]


@njit(inline="always")
def normalise(q):
    """q scaled to unit length (4-tuple); a quaternion of length 0 becomes the identity."""
    n = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if n < 1e-12:
        return 1.0, 0.0, 0.0, 0.0
    return q[0] / n, q[1] / n, q[2] / n, q[3] / n


@njit(inline="always")
def rotate(q, x, y, z):
    """The vector (x, y, z) of the body expressed in the world (3 floats)."""
    tx = 2.0 * (q[2] * z - q[3] * y)
    ty = 2.0 * (q[3] * x - q[1] * z)
    tz = 2.0 * (q[1] * y - q[2] * x)
    return (
        x + q[0] * tx + q[2] * tz - q[3] * ty,
        y + q[0] * ty + q[3] * tx - q[1] * tz,
        z + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@njit(inline="always")
def rotate_back(q, x, y, z):
    """The vector (x, y, z) of the world expressed in the body (3 floats)."""
    return rotate((q[0], -q[1], -q[2], -q[3]), x, y, z)


@njit(inline="always")
def body_z(q):
    """The body's z axis (thrust direction in FLU) in the world (3 floats, unit)."""
    return (
        2.0 * (q[1] * q[3] + q[0] * q[2]),
        2.0 * (q[2] * q[3] - q[0] * q[1]),
        1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]),
    )


@njit
def to_matrix(q):
    """Rotation matrix (3, 3) of a unit quaternion; its columns are the body's axes in the world."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    m = np.empty((3, 3))
    m[0, 0], m[0, 1], m[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    m[1, 0], m[1, 1], m[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    m[2, 0], m[2, 1], m[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    return m


@njit
def from_matrix(m):
    """Unit quaternion (4-tuple, w >= 0) of a rotation matrix (3, 3); the largest element is the pivot (Shepperd)."""
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    if trace > m[0, 0] and trace > m[1, 1] and trace > m[2, 2]:
        q = (1.0 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])
    elif m[0, 0] >= m[1, 1] and m[0, 0] >= m[2, 2]:
        q = (m[2, 1] - m[1, 2], 1.0 + m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[0, 2] + m[2, 0])
    elif m[1, 1] >= m[2, 2]:
        q = (m[0, 2] - m[2, 0], m[1, 0] + m[0, 1], 1.0 + m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2])
    else:
        q = (m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2], 1.0 + m[2, 2] - m[0, 0] - m[1, 1])
    if q[0] < 0.0:
        q = (-q[0], -q[1], -q[2], -q[3])
    return normalise(q)


@njit(inline="always")
def from_rotation_vector(x, y, z):
    """Unit quaternion (4-tuple) of a rotation by |v| rad about v."""
    squared = 0.25 * (x * x + y * y + z * z)
    if squared < 1e-4:  # the series' next terms are below 1e-14 here
        s = 0.5 * (1.0 - squared / 6.0 + squared * squared / 120.0)
        return 1.0 - 0.5 * squared + squared * squared / 24.0 - squared * squared * squared / 720.0, s * x, s * y, s * z
    half = math.sqrt(squared)
    s = 0.5 * math.sin(half) / half
    return math.cos(half), s * x, s * y, s * z


@njit(inline="always")
def from_small_rotation(x, y, z):
    """`from_rotation_vector` for |v| < 0.2 rad, to 2e-15 and without a branch; nearly a unit quaternion beyond."""
    squared = 0.25 * (x * x + y * y + z * z)
    s = 0.5 * (1.0 + squared * (-1.0 / 6.0 + squared * (1.0 / 120.0 - squared / 5040.0)))
    c = 1.0 + squared * (-0.5 + squared * (1.0 / 24.0 + squared * (-1.0 / 720.0 + squared / 40320.0)))
    return c, s * x, s * y, s * z


@njit
def to_rotation_vector(q):
    """Rotation vector (3 floats, |v| <= pi rad) of a unit quaternion."""
    sign = 1.0 if q[0] >= 0.0 else -1.0
    n = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = 2.0 * sign if n < 1e-9 else 2.0 * math.atan2(n, sign * q[0]) / n * sign
    return scale * q[1], scale * q[2], scale * q[3]


@njit(inline="always")
def integrate(q, wx, wy, wz, dt):
    """q (4-tuple) after turning for `dt` seconds at the constant body rate (wx, wy, wz) rad/s."""
    return normalise(multiply(q, from_rotation_vector(wx * dt, wy * dt, wz * dt)))


@njit
def from_euler(roll, pitch, yaw):
    """Unit quaternion (4-tuple) of Rz(yaw) Ry(pitch) Rx(roll), in whatever pair of frames the angles belong to."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@njit
def to_euler(q):
    """Roll, pitch, yaw (rad) with q = Rz(yaw) Ry(pitch) Rx(roll); pitch is clamped to +-pi/2."""
    sine = clip(2.0 * (q[0] * q[2] - q[3] * q[1]), -1.0, 1.0)
    return (
        math.atan2(2.0 * (q[0] * q[1] + q[2] * q[3]), 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])),
        math.asin(sine),
        math.atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3])),
    )


@njit
def yaw(q):
    """Heading of the body's x axis, rad, counter-clockwise from the world's x axis (ENU: from east)."""
    return math.atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))


@njit
def angle_between(a, b):
    """Angle (rad, 0..pi) of the rotation from a to b."""
    dot = abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3])
    return 2.0 * math.acos(clip(dot, 0.0, 1.0))


@njit(inline="always")
def swap_world(x, y, z):
    """ENU vector as NED, or NED as ENU: the swap is its own inverse (3 floats)."""
    return y, x, -z


@njit(inline="always")
def swap_body(x, y, z):
    """FLU vector as FRD, or FRD as FLU: the swap is its own inverse (3 floats)."""
    return x, -y, -z


@njit(inline="always")
def swap_attitude(q):
    """ENU-from-FLU quaternion as NED-from-FRD, or back: its own inverse (4-tuple, sign kept as it falls)."""
    return _R * (q[0] + q[3]), _R * (q[1] + q[2]), _R * (q[1] - q[2]), _R * (q[0] - q[3])


@njit(inline="always")
def wrap_angle(angle):
    """`angle` (rad) brought into [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@njit(inline="always")
def swap_yaw(angle):
    """Heading counter-clockwise from east as heading clockwise from north (rad, [-pi, pi)), or back."""
    return wrap_angle(0.5 * math.pi - angle)
