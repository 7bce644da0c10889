"""The software PX4 beside a real firmware, on one plant: `PERCH_HIL_PX4=BUILD python -m benchmarks.bench_autopilots`.

Both are flown by the same driver to a hover, then through the same steps of body rate and thrust. Of each: delay and
rise of the true body rate, thrust that came for the thrust that was asked, and how the odometry differs from the truth.
Without a build folder of PX4 the software PX4 alone is flown.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hil.assembly.hitl import BUILD, HitlWires, free_instance, offboard_url
from hil.assembly.rig import load_rig
from hil.contract.wire import memory_pair
from hil.host.lockstep import Clock
from hil.wires.barrier import BarrierWire
from hil.wires.url import open_url
from kernel.rotations import rotate_back
from vehicle.px4.driver.arming import Arming
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig, Rates
from vehicle.px4.hitl.device import BASE_US, HitlVehicle
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

FRAME = load_airframe("paper_quad")
START = (0.0, 0.0, 25.0, 0.3)
HALF_S = 0.4  # of a step, which is followed by its opposite
STEPS = [(axis, size) for axis in range(3) for size in (1.0, 3.0)]
THRUSTS = (6.0, 13.0, 8.0, 11.0)  # m/s^2, asked
THRUST_S = 0.5
AXES = ("roll", "pitch", "yaw")


def commands() -> list[tuple[float, Rates]]:
    """(s since the hand-over, what is asked from then on)."""
    still = Rates((0.0, 0.0, 0.0), GRAVITY)
    rows, at = [(0.0, still)], 1.0
    for axis, size in STEPS:
        for part in (size, -size):
            rate = [0.0, 0.0, 0.0]
            rate[axis] = part
            rows.append((at, Rates((rate[0], rate[1], rate[2]), GRAVITY)))
            at += HALF_S if size < 2 else HALF_S / 2
        rows.append((at, still))
        at += 0.4
    for thrust in THRUSTS:
        rows.append((at, Rates((0.0, 0.0, 0.0), thrust)))
        at += THRUST_S
    return [*rows, (at, still)]


def fly(body: Any, wire: Any, clock: Clock, system: int, fixed_ns: int | None) -> dict[str, np.ndarray]:
    """Truth (s, w, v, q), odometry (s, p, v, w, and the truth's), from the hand-over on."""
    link = Px4Link(wire, LinkConfig(
        start=START, hover_thrust=FRAME.hover_thrust, system=system, fixed_offset_ns=fixed_ns, arm=False,
    ))  # fmt: skip
    link.allow_arming(Arming())
    rows, end_s = commands(), commands()[-1][0]
    began, truths, seen = None, [], []
    history: dict[int, Any] = {}
    while clock.now_ns < 120_000_000_000:
        if clock.now_ns % 4_000_000 == 0:
            body.step(clock.now_ns)
            history[clock.now_ns] = truth = body.truth()
            if began is not None:
                at = (clock.now_ns - began) * 1e-9
                truths.append((at, *truth.body_rate, *truth.velocity, *truth.orientation))
                if at > end_s:
                    break
        command = None
        if link.phase in ("hover", "handed_over") and clock.now_ns % 10_000_000 == 0:
            began = clock.now_ns if began is None else began
            at = (clock.now_ns - began) * 1e-9
            command = [rates for since, rates in rows if since <= at + 1e-9][-1]
        for one in link.step(clock.now_ns, command).odometry:
            then = history.get(round(one.stamp_ns / 4e6) * 4_000_000)
            if began is not None and then is not None:
                apart = np.subtract(one.position, then.position), np.subtract(one.velocity, then.velocity)
                turning = np.subtract(one.body_rate, then.body_rate)
                seen.append(((one.stamp_ns - began) * 1e-9, *apart[0], *apart[1], *turning, *one.body_rate))
        if link.phase == "failed":
            raise SystemExit("the driver gave up before the hover")
        clock.now_ns += 2_000_000
    return {"truth": np.array(truths), "odometry": np.array(seen)}


def software() -> dict[str, np.ndarray]:
    clock = Clock()
    near, far = memory_pair(clock, 1_000_000)
    return fly(Px4Sim({"api": far}, FRAME, 1, yaw=0.3), near, clock, 1, None)


def firmware() -> dict[str, np.ndarray]:
    slot, clock = load_rig("px4-firmware").vehicle, Clock()
    instance = free_instance(slot)
    offboard = BarrierWire(open_url(offboard_url(slot, instance), 1 + instance), lambda: BASE_US + clock.now_ns // 1000)
    wires = HitlWires(slot, instance)
    try:
        body = HitlVehicle(wires.simulator, FRAME, 1, (0.0, 0.0, 0.0), 0.3)
        wires.start(Path(tempfile.mkdtemp()))
        return fly(body, offboard, clock, 1 + instance, BASE_US * 1000)
    finally:
        wires.close()
        offboard.close()


def rise(truth: np.ndarray, axis: int, size: float, at: float) -> tuple[float, float, float]:
    """(ms to 10 %, ms from 10 to 90 %, largest share reached) of the step asked at `at` s."""
    lasts = HALF_S if size < 2 else HALF_S / 2
    part = truth[(truth[:, 0] >= at - 0.004) & (truth[:, 0] <= at + lasts)]
    share = part[:, 1 + axis] / size
    cross = [float(np.interp(level, np.maximum.accumulate(share), part[:, 0])) - at for level in (0.1, 0.9)]
    return 1000 * cross[0], 1000 * (cross[1] - cross[0]), float(share.max())


def thrust(truth: np.ndarray, at: float) -> float:
    """Mean thrust over mass (m/s^2) in the last 0.2 s of a level of thrust; drag is left in."""
    part = truth[(truth[:, 0] >= at + THRUST_S - 0.2) & (truth[:, 0] <= at + THRUST_S)]
    force = (part[-1, 4:7] - part[0, 4:7]) / (part[-1, 0] - part[0, 0]) + np.array([0.0, 0.0, GRAVITY])
    middle = part[len(part) // 2]
    return rotate_back(tuple(middle[7:11]), *force)[2]


def report(name: str, flown: dict[str, np.ndarray]) -> None:
    truth, seen = flown["truth"], flown["odometry"]
    print(f"\n{name}\n  step         delay ms  rise ms  peak")
    asked = [row for row in commands() if any(row[1].body_rate)][::2]
    for (axis, size), (at, _) in zip(STEPS, asked, strict=True):
        delay, took, peak = rise(truth, axis, size, at)
        print(f"  {AXES[axis]:5s} {size:.0f} rad/s  {delay:8.1f} {took:8.1f} {peak:6.3f}")
    levels = [row for row in commands() if row[1].thrust != GRAVITY]
    print("  thrust m/s^2 " + ", ".join(f"{row[1].thrust:g}: {thrust(truth, row[0]):.2f}" for row in levels))
    still, steady = seen[seen[:, 0] < 1.0], np.sqrt(np.mean(seen[:, 1:10] ** 2, axis=0))
    jumps = np.sqrt(np.mean(np.diff(still[:, 10:13], axis=0) ** 2, axis=0))
    print(f"  odometry: {len(seen) / seen[-1, 0]:.0f} Hz; rms error position {steady[:3].round(3)} m, "
          f"velocity {steady[3:6].round(3)} m/s, body rate {steady[6:].round(3)} rad/s; "
          f"body rate sample to sample at hover {jumps.round(4)} rad/s")  # fmt: skip


def main() -> None:
    flights: list[tuple[str, Callable[[], dict[str, np.ndarray]]]] = [("software PX4", software)]
    if os.environ.get(BUILD):
        flights.append(("real firmware", firmware))
    for name, flight in flights:
        report(name, flight())
    sys.stdout.flush()


if __name__ == "__main__":
    main()
