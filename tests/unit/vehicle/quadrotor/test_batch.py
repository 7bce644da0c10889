"""Many vehicles side by side fly as each would alone, bit for bit."""

import platform
import re

import numba
import numpy as np
import pytest

from vehicle.quadrotor import airframe as af
from vehicle.quadrotor import batch as fleet
from vehicle.quadrotor import dynamics as d
from vehicle.quadrotor.rate_control import fly

PERIOD, SUBSTEPS = 0.01, 5


def scattered(count, seed=3):
    rng = np.random.default_rng(seed)
    nominal = af.load_airframe("paper_quad").params_row()
    params = np.tile(nominal, (count, 1))
    params[:, [af.MASS, af.MOTOR_LAG, af.MOTOR_THRUST]] *= rng.uniform(0.7, 1.3, (count, 3))
    rows = np.stack([d.vehicle_row(rng.normal(0.0, 2.0, 3), motor=0.4) for _ in range(count)])
    rows[:, d.W : d.W + 3] = rng.normal(0.0, 2.0, (count, 3))
    rows[:, d.WIND : d.WIND + 3] = rng.normal(0.0, 2.0, (count, 3))
    return rows, params, rng


def orders_for(rng, count, violence):
    orders = np.zeros((count, fleet.ORDER_DIM))
    for at in (fleet.OLDER, fleet.NEWER):
        orders[:, at : at + 3] = rng.normal(0.0, violence, (count, 3))
        orders[:, at + 3] = rng.uniform(2.0, 25.0, count)
    orders[:, fleet.SINCE] = rng.integers(0, SUBSTEPS + 1, count)
    return orders


def alone(row, order, params):
    """One period of the order, flown by `fly` in two parts."""
    older, newer = order[fleet.OLDER : fleet.OLDER + 4].copy(), order[fleet.NEWER : fleet.NEWER + 4].copy()
    for step in range(SUBSTEPS):
        fly(row, newer if step >= order[fleet.SINCE] else older, params, PERIOD / SUBSTEPS, 1)


@pytest.mark.parametrize("count", [1, 7, 8, 21])
@pytest.mark.parametrize(("violence", "some_saturate"), [(0.05, False), (6.0, True)])
def test_a_fleet_flies_as_each_vehicle_would_alone(count, violence, some_saturate):
    rows, params, rng = scattered(count)
    each, saturated = rows.copy(), False
    if not some_saturate:
        rows[:, d.W : d.W + 3] = each[:, d.W : d.W + 3] = 0.0
    for _ in range(30):
        orders = orders_for(rng, count, violence)
        if not some_saturate:
            orders[:, [fleet.OLDER + 3, fleet.NEWER + 3]] = af.GRAVITY
        fleet.fly_rows(rows, orders, params, PERIOD, SUBSTEPS)
        for row, order, airframe in zip(each, orders, params, strict=True):
            alone(row, order, airframe)
        saturated |= bool((rows[:, d.HEADROOM_UP : d.ND] == 0.0).any())
        np.testing.assert_array_equal(rows, each)
    assert saturated is some_saturate


def test_a_rate_that_is_nan_keeps_the_present_rate_and_troubles_no_neighbour():
    rows, params, rng = scattered(8)
    orders = orders_for(rng, 8, 1.0)
    calm = rows.copy()
    fleet.fly_rows(calm, orders, params, PERIOD, SUBSTEPS)
    orders[3, [fleet.OLDER + 2, fleet.NEWER + 2]] = np.nan
    fleet.fly_rows(rows, orders, params, PERIOD, SUBSTEPS)
    assert np.isfinite(rows).all()
    others = np.arange(8) != 3
    np.testing.assert_array_equal(rows[others], calm[others])
    assert rows[3, d.W + 2] != calm[3, d.W + 2]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="names of instructions are those of x86_64")
def test_the_loops_over_vehicles_are_vector_instructions():
    rows, params, rng = scattered(8)
    fresh = numba.njit(error_model="numpy")(fleet.fly_block.py_func)
    fresh(rows, orders_for(rng, 8, 1.0), params, 0, PERIOD / SUBSTEPS, SUBSTEPS)
    [code] = fresh.inspect_asm().values()
    packed, scalar = (len(re.findall(rf"\bv?mul{kind}\b", code)) for kind in ("pd", "sd"))
    assert packed > 5 * scalar
