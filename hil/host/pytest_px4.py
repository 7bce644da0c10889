"""A plugin of pytest: the fixture `px4_sim` starts software PX4s on free ports, for tests of other people's code.

def test_takes_off(px4_sim):
    px4 = px4_sim()                                  # real time, booted; connect MAVSDK to px4.url
def test_lands_on_a_broken_motor(px4_sim):
    px4 = px4_sim("paper_quad", lockstep=True)       # virtual time: px4.run(2.0)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from hil.host.standalone import StandalonePx4


@pytest.fixture
def px4_sim() -> Iterator[Callable[..., StandalonePx4]]:
    """`px4_sim(airframe="sih_quad", *, lockstep=False, speed=1.0, seed=0, parameters=None)` -> `StandalonePx4`.

    Each call starts one, booted and on the ground, on a free port of the loopback; all end with the test. With
    `lockstep` its time passes in `run` only, so that the same test gives the same flight; without, in a thread at
    `speed` times wall time.
    """
    from hil.host.standalone import BOOTED_S, StandalonePx4

    started: list[StandalonePx4] = []

    def start(
        airframe: str = "sih_quad", *, lockstep: bool = False, speed: float = 1.0, seed: int = 0,
        parameters: Mapping[str, float] | None = None,
    ) -> StandalonePx4:  # fmt: skip
        px4 = StandalonePx4(airframe, seed=seed, parameters=parameters)
        started.append(px4)
        px4.run(BOOTED_S)
        if not lockstep:
            px4.start(speed)
        return px4

    yield start
    for px4 in started:
        px4.close()
