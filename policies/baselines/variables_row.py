"""Indices of the variables of Fast-Perching's search, (DIM,)."""

from __future__ import annotations

from policies.baselines.min_snap import PIECES

TIME = 0  # maps to the s a piece lasts, see `fast_perching_cost.piece_seconds`
WAYPOINTS = 1  # 3 m each, between the pieces
FORCE = WAYPOINTS + 3 * (PIECES - 1)  # rad, maps to the thrust at contact
SKID = FORCE + 1  # 2, m/s at contact along the board's two tangents
DIM = SKID + 2
