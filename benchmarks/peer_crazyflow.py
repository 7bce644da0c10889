"""crazyflow 0.4 on this machine: control steps a second of its simulation and of its landing environment, as JSON.

Run by bench_env with the interpreter of a virtual environment of its own (`make peer`), as it brings JAX and MuJoCo.
First principles and body-rate control, 5 substeps of 2 ms a control step of 10 ms, as ours; on the CPU. The landing
environment with its own defaults, at the same 100 Hz.

    .venv/peer/bin/python benchmarks/peer_crazyflow.py COUNT SECONDS
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable

os.environ["JAX_PLATFORMS"] = "cpu"


def rate(step: Callable[[], object], count: int, seconds: float) -> tuple[float, float]:
    """Control steps a second and a CPU second, each the best of three spells; `step` returns what to wait for."""
    import jax

    jax.block_until_ready(step())
    wall = cpu = 0.0
    for _ in range(3):
        begun, used, steps = time.perf_counter(), time.process_time(), 0
        while time.perf_counter() - begun < seconds / 3.0:
            jax.block_until_ready(step())
            steps += 1
        wall = max(wall, steps * count / (time.perf_counter() - begun))
        cpu = max(cpu, steps * count / (time.process_time() - used))
    return wall, cpu


def main() -> None:
    import jax.numpy as jnp
    from crazyflow.control import Control
    from crazyflow.dynamics import Dynamics
    from crazyflow.envs.landing_env import LandingEnv
    from crazyflow.sim import Sim

    count, seconds = int(sys.argv[1]), float(sys.argv[2])
    sim = Sim(n_worlds=count, dynamics=Dynamics.first_principles, control=Control.body_rate, freq=500)
    sim.reset()
    command = jnp.zeros((count, 1, 4)).at[..., 3].set(0.35)

    def fly() -> object:
        sim.body_rate_control(command)
        sim.step(5)
        return sim.data.states.pos

    env = LandingEnv(num_envs=count, freq=100)
    env.reset()
    action = jnp.zeros((count, 4))
    found = {"vehicle": rate(fly, count, seconds), "gym": rate(lambda: env.step(action)[0], count, seconds)}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
