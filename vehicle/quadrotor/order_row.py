"""Indices of an order row, (DIM,) float64: the commands of one vehicle over one control period."""

from vehicle.quadrotor import command_row

OLDER, NEWER = 0, command_row.DIM  # a command row each
SINCE = 2 * command_row.DIM  # substep from which the newer one acts
DIM = 2 * command_row.DIM + 1
