"""Many vehicles side by side fly as each would alone, bit for bit."""

import platform
import re

import numba
import numpy as np
import pytest

from vehicle.quadrotor import airframe as af
from vehicle.quadrotor import airframe_row, batch, order_row, state_row
from vehicle.quadrotor import dynamics as d
from vehicle.quadrotor.rate_control import fly

PERIOD, SUBSTEPS = 0.01, 5


def scattered(count, seed=3):
    rng = np.random.default_rng(seed)
    nominal = af.load_airframe("paper_quad").params_row()
    params = np.tile(nominal, (count, 1))
    params[:, [airframe_row.MASS, airframe_row.MOTOR_LAG, airframe_row.MOTOR_THRUST]] *= rng.uniform(
        0.7, 1.3, (count, 3)
    )
    rows = np.stack([d.vehicle_row(rng.normal(0.0, 2.0, 3), motor=0.4) for _ in range(count)])
    rows[:, state_row.W : state_row.W + 3] = rng.normal(0.0, 2.0, (count, 3))
    rows[:, state_row.WIND : state_row.WIND + 3] = rng.normal(0.0, 2.0, (count, 3))
    return rows, params, rng


def orders_for(rng, count, violence):
    orders = np.zeros((count, order_row.DIM))
    for at in (order_row.OLDER, order_row.NEWER):
        orders[:, at : at + 3] = rng.normal(0.0, violence, (count, 3))
        orders[:, at + 3] = rng.uniform(2.0, 25.0, count)
    orders[:, order_row.SINCE] = rng.integers(0, SUBSTEPS + 1, count)
    return orders


def alone(row, order, params):
    """One period of the order, flown by `fly` in two parts."""
    older, newer = (
        order[order_row.OLDER : order_row.OLDER + 4].copy(),
        order[order_row.NEWER : order_row.NEWER + 4].copy(),
    )
    for step in range(SUBSTEPS):
        fly(row, newer if step >= order[order_row.SINCE] else older, params, PERIOD / SUBSTEPS, 1)


@pytest.mark.parametrize("count", [1, 7, 8, 21])
@pytest.mark.parametrize(("violence", "some_saturate"), [(0.05, False), (6.0, True)])
def test_batch_equals_single_vehicles_bit_for_bit(count, violence, some_saturate):
    rows, params, rng = scattered(count)
    each, saturated = rows.copy(), False
    if not some_saturate:
        rows[:, state_row.W : state_row.W + 3] = each[:, state_row.W : state_row.W + 3] = 0.0
    for _ in range(30):
        orders = orders_for(rng, count, violence)
        if not some_saturate:
            orders[:, [order_row.OLDER + 3, order_row.NEWER + 3]] = af.GRAVITY
        batch.fly_rows(rows, orders, params, PERIOD, SUBSTEPS)
        for row, order, airframe in zip(each, orders, params, strict=True):
            alone(row, order, airframe)
        saturated |= bool((rows[:, state_row.HEADROOM_UP : state_row.DIM] == 0.0).any())
        np.testing.assert_array_equal(rows, each)
    assert saturated is some_saturate


def test_nan_rate_keeps_the_present_rate_and_leaves_other_columns_unchanged():
    rows, params, rng = scattered(8)
    orders = orders_for(rng, 8, 1.0)
    calm = rows.copy()
    batch.fly_rows(calm, orders, params, PERIOD, SUBSTEPS)
    orders[3, [order_row.OLDER + 2, order_row.NEWER + 2]] = np.nan
    batch.fly_rows(rows, orders, params, PERIOD, SUBSTEPS)
    assert np.isfinite(rows).all()
    others = np.arange(8) != 3
    np.testing.assert_array_equal(rows[others], calm[others])
    assert rows[3, state_row.W + 2] != calm[3, state_row.W + 2]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="names of instructions are those of x86_64")
def test_loops_over_vehicles_compile_to_vector_instructions():
    rows, params, rng = scattered(8)
    fresh = numba.njit(error_model="numpy")(batch.fly_block.py_func)
    fresh(rows, orders_for(rng, 8, 1.0), params, 0, PERIOD / SUBSTEPS, SUBSTEPS)
    [code] = fresh.inspect_asm().values()
    packed, scalar = (len(re.findall(rf"\bv?mul{kind}\b", code)) for kind in ("pd", "sd"))
    assert packed > 5 * scalar
