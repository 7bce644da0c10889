"""A vehicle close to contact, for the tests of guidance."""

import math

import numpy as np

from groundcar.motion.pose import board_normal
from kernel.rotations import body_z, from_rotation_vector, multiply
from policies.guidance.params import GuidanceParams
from vehicle.quadrotor.airframe import load_airframe

PARAMS = GuidanceParams.of(load_airframe("paper_quad"), lean_uncertain=0.0)


def situation(inclination, lean, tilt, left, closing=0.6, speed=2.0, turn=0.0, heading=0.4, beside=0.0):
    """A vehicle `left` s before contact, body z off the normal by `lean` up the slope and `tilt` to the side."""
    board = np.array([3.0, -2.0, 1.5, heading, speed, turn, inclination, 0.0])
    n = np.array(board_normal(board))
    c, s = math.cos(heading), math.sin(heading)
    up = np.array([math.cos(inclination) * c, math.cos(inclination) * s, math.sin(inclination)])
    turned = multiply((math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)), from_rotation_vector(0, lean, 0))
    turned = multiply(turned, from_rotation_vector(0.0, -inclination, 0.0))
    q = np.array(multiply(multiply(turned, from_rotation_vector(tilt, 0.0, 0.0)), from_rotation_vector(0, 0, 0.3)))
    cosine = min(1.0, float(n @ np.array(body_z(q))))
    height = closing * left + PARAMS.below * cosine + PARAMS.radius * math.sqrt(1.0 - cosine * cosine)
    p = board[:3] + height * n + beside * up
    v = speed * np.array([c, s, 0.0]) - closing * n
    return board, p, v, q
