"""Minimum-snap motions of PIECES equal pieces as constant matrices; a plan changes only what they are multiplied by.

Time is counted in pieces, so a motion is A @ boundary for every axis, boundary (BOUNDARY,) = [p0, v0 h, a0 h^2, j0 h^3,
way points, p1, v1 h, a1 h^2, j1 h^3] with h s a piece: among all curves through these, the one whose integral of
squared snap is least (Wang et al., "Geometrically constrained trajectory optimization", T-RO 2022, order s = 4).
"""

from __future__ import annotations

from functools import lru_cache
from math import factorial
from typing import NamedTuple

import numpy as np

PIECES, ORDER = 10, 8  # ORDER coefficients a piece: degree seven
HEAD, WAYPOINTS, END = 0, 4, 4 + PIECES - 1  # where a boundary's parts begin
BOUNDARY = END + 4
SAMPLES = 16  # intervals a piece, at whose ends a motion is sampled


class MinSnap(NamedTuple):
    """`coefficients` ((PIECES, ORDER, BOUNDARY)), lowest power first.

    `energy` ((BOUNDARY, BOUNDARY)): b @ energy @ b is the integral of squared snap. `sampled` ((4, BOUNDARY, samples)):
    position, velocity, acceleration and jerk at the PIECES * (SAMPLES + 1) samples; `by_sample`: last axes swapped.
    """

    coefficients: np.ndarray
    energy: np.ndarray
    sampled: np.ndarray
    by_sample: np.ndarray


def basis(tau: float, derivative: int) -> np.ndarray:
    """The `derivative`-th derivatives of 1, tau, tau^2, ..., (ORDER,)."""
    row = np.zeros(ORDER)
    for k in range(derivative, ORDER):
        row[k] = factorial(k) / factorial(k - derivative) * tau ** (k - derivative)
    return row


@lru_cache(maxsize=1)
def min_snap() -> MinSnap:
    """The matrices, computed once."""
    size = PIECES * ORDER
    system, right = np.zeros((size, size)), np.zeros((size, BOUNDARY))
    at = 0
    for d in range(4):
        system[at, :ORDER], right[at, HEAD + d] = basis(0.0, d), 1.0
        system[at + 1, -ORDER:], right[at + 1, END + d] = basis(1.0, d), 1.0
        at += 2
    for k in range(PIECES - 1):
        here, there = slice(k * ORDER, (k + 1) * ORDER), slice((k + 1) * ORDER, (k + 2) * ORDER)
        system[at, here], right[at, WAYPOINTS + k] = basis(1.0, 0), 1.0
        at += 1
        for d in range(ORDER - 1):  # least snap makes the first six derivatives continuous
            system[at, here], system[at, there] = basis(1.0, d), -basis(0.0, d)
            at += 1
    coefficients = np.linalg.solve(system, right).reshape(PIECES, ORDER, BOUNDARY)
    piece = np.zeros((ORDER, ORDER))
    for i in range(4, ORDER):
        for j in range(4, ORDER):
            scale = factorial(i) / factorial(i - 4) * factorial(j) / factorial(j - 4)
            piece[i, j] = scale / (i + j - 7)
    energy = np.einsum("kib,ij,kjc->bc", coefficients, piece, coefficients)
    grid = np.linspace(0.0, 1.0, SAMPLES + 1)
    by_sample = np.array([[basis(tau, d) @ part for part in coefficients for tau in grid] for d in range(4)])
    return MinSnap(coefficients, energy, np.ascontiguousarray(by_sample.transpose(0, 2, 1)), by_sample)
