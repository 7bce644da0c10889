"""Cost of one control period of the quadrotor kernel, alone and mapped over rows: `-m benchmarks.bench_dynamics`."""

from __future__ import annotations

import time

import numpy as np

from kernel.jit import njit
from vehicle.quadrotor import order_row
from vehicle.quadrotor.airframe import GRAVITY, load_airframe
from vehicle.quadrotor.batch import fly_rows
from vehicle.quadrotor.dynamics import vehicle_row
from vehicle.quadrotor.rate_control import fly


@njit
def _one(row, ctbr, params, periods):
    for _ in range(periods):
        fly(row, ctbr, params, 0.01, 5)


def run() -> dict[str, float]:
    """Microseconds per 10 ms control period at 500 Hz: in a compiled loop, 4096 rows, called from Python."""
    airframe = load_airframe("paper_quad")
    params, ctbr = airframe.params_row(), np.array([0.1, -0.1, 0.1, GRAVITY])
    row = vehicle_row((0.0, 0.0, 5.0), motor=airframe.hover_thrust)
    _one(row, ctbr, params, 1)
    start = time.perf_counter()
    _one(row, ctbr, params, 100_000)
    single = (time.perf_counter() - start) * 10.0
    rows, many = np.tile(row, (4096, 1)), np.tile(params, (4096, 1))
    orders = np.zeros((4096, order_row.DIM))
    orders[:, order_row.NEWER : order_row.NEWER + 4] = ctbr
    fly_rows(rows, orders, many, 0.01, 5)
    start = time.perf_counter()
    for _ in range(50):
        fly_rows(rows, orders, many, 0.01, 5)
    mapped = (time.perf_counter() - start) / (4096 * 50) * 1e6
    fly(row, ctbr, params, 0.01, 5)
    start = time.perf_counter()
    for _ in range(10_000):
        fly(row, ctbr, params, 0.01, 5)
    called = (time.perf_counter() - start) * 100.0
    return {"compiled loop": single, "4096 rows, all threads": mapped, "one call from Python": called}


if __name__ == "__main__":
    for name, microseconds in run().items():
        print(f"{name:26s} {microseconds:7.3f} us per control period")
