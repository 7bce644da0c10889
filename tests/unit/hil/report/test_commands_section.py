"""The commands section: what the policy asked beside what guidance made of it, in new recordings and in older ones."""

from types import SimpleNamespace

import numpy as np

from hil.contract.codec import Codec
from hil.contract.messages import Action
from hil.report.drawing.charts import TimePlot
from hil.report.sections import commands
from policies.guidance.guide import ALIGNED, BRAKED
from tests.unit.hil.report.recorded.test_columns import columns

RECORDED = SimpleNamespace(decided_ns=0, during=lambda t: np.ones(len(t), dtype=bool))


def action(ms, rate, thrust, **guided):
    return Action(ms * 1_000_000, True, (rate, 0.0, 0.0), thrust, "network", 0, 1.0, **guided)


def plotted(actions):
    table, plots = columns(Action, actions), {}
    for name, unguided, axis in (("body_rate", "asked_rate", 0), ("thrust", "asked_thrust", None)):
        plot = TimePlot(name, name, "")
        commands._both(plot, RECORDED, table, None, name, unguided, axis)
        plots[name] = {s.name: s.y.tolist() for s in plot.series}
    return table, plots


def test_asked_and_changed_commands_are_drawn_where_guidance_acted():
    table, plots = plotted([
        action(0, 1.0, 9.0, asked_rate=(1.0, 0.0, 0.0), asked_thrust=9.0),
        action(10, 2.0, 9.0, asked_rate=(0.5, 0.0, 0.0), asked_thrust=9.0, laws=ALIGNED),
        action(20, 1.0, 12.0, asked_rate=(1.0, 0.0, 0.0), asked_thrust=8.0, laws=ALIGNED | BRAKED),
    ])  # fmt: skip
    assert plots["body_rate"] == {"asked": [1.0, 0.5, 1.0], "changed by guidance": [2.0]}
    assert plots["thrust"] == {"asked": [9.0, 9.0, 8.0], "changed by guidance": [12.0]}
    counts = dict(commands._laws(RECORDED, table))
    assert counts == {"terminal attitude alignment": 2, "time-to-go flare": 0, "impact-speed limit": 1}


def test_recording_without_guidance_shows_the_asked_command():
    codec = Codec(Action)
    older = [codec.decode(codec.encode(action(ms, 1.0, 9.0))) for ms in (0, 10)]
    table, plots = plotted(older)
    assert plots == {"body_rate": {"asked": [1.0, 1.0]}, "thrust": {"asked": [9.0, 9.0]}}
    assert not commands._guided(table).any()
