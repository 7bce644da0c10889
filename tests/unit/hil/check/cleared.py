"""A field site in a folder: a rig with real devices and all the files that it names, and signed goes for it."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

from hil.assembly.rig import Rig, load_rig
from hil.check import records
from hil.check.checklist import Checklist, load_checklist
from hil.check.interlock import Clearance, clear_to_arm
from hil.check.judge import Outcome
from hil.check.moment import Moment
from hil.check.records import Record
from hil.check.session import new_record
from hil.check.subject import subject
from scenarios.spec import FOLDER as SCENARIOS
from scenarios.spec import load
from vehicle.px4.driver.arming import Arming, Identity
from vehicle.quadrotor.airframe import AIRFRAME_DIR

NOW = Moment(datetime(2026, 1, 2, 12, 0, 0, tzinfo=UTC))
AUTOPILOT = Arming(Identity("4954500000000001", "1.17.0 d6f12ad1c4f7"), {"COM_OF_LOSS_T": 0.3, "COM_OBL_RC_ACT": 4})
ONE_QUESTION = 'title = "one"\nkind = "preflight"\n[[group]]\ntitle = "g"\n[[group.item]]\nask = "Well?"\n'


class Site:
    """`folder` holds the rig's list, airframe and signing key, a scenario and a policy; goes lie in its `checks`."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.checks = folder, folder / "checks"
        self.file("list.toml", ONE_QUESTION)
        self.file("frame.toml", (AIRFRAME_DIR / "paper_quad.toml").read_text())
        self.file("mine.toml", (SCENARIOS / "hard_i.toml").read_text().replace('"hard-i"', '"mine"'))
        self.file("policy.onnx", "a network")
        self.file("vehicle.key", "k" * 32).chmod(0o600)
        vehicle = {
            "kind": "mavlink", "url": "udp://:14540", "airframe": str(folder / "frame.toml"),
            "signing_key": str(folder / "vehicle.key"),
        }  # fmt: skip
        self.rig = Rig.model_validate({"title": "field", "preflight": str(folder / "list.toml"), "vehicle": vehicle})
        self.policy, self.scenario = str(folder / "policy.onnx"), str(folder / "mine.toml")

    def file(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.write_text(text)
        return path

    def go(self, outcome: Outcome = Outcome.PASS, when: Moment = NOW, key=None, name: str = "field", **more) -> Path:
        """A record of the rig's list, signed at `when`; `more`: rig, policy, scenario, checklist or autopilot of it."""
        checklist: Checklist = more.get("checklist") or load_checklist(self.rig.preflight)
        about = subject(
            name, more.get("rig", self.rig), more.get("policy", self.policy), load(more.get("scenario", self.scenario))
        )
        record: Record = new_record(checklist, about)
        for entry in record.entries:
            entry.outcome = outcome
        record.started_utc = records.iso(when.utc)
        record.autopilot = more.get("autopilot", AUTOPILOT.table())
        if more.get("sign", True):
            record.sign("Ann", when, key)
        path = self.checks / f"{len(list(self.checks.glob('*.json')))}.json"
        records.write(path, record)
        return path

    def clear(self, rig: Rig | None = None, now: Moment = NOW, name: str = "field", **more) -> Clearance:
        """What the interlock says to the site's rig, policy and scenario, or to those in `more`."""
        policy, scenario = more.pop("policy", self.policy), more.pop("scenario", self.scenario)
        return clear_to_arm(name, rig or self.rig, policy, load(scenario), folder=self.checks, now=now, **more)


def later(seconds: float, boot: str = "", uptime_s: float = 0.0) -> Moment:
    """A moment that much after `NOW` by the date, and the given one by the other clock."""
    return Moment(NOW.utc + timedelta(seconds=seconds), boot, round(uptime_s * 1e9))


def real_car(**more) -> Rig:
    """A rig whose only real device is the car: no autopilot to be bound to."""
    sim = load_rig("sim")
    return sim.model_copy(update={"groundcar": sim.groundcar.model_copy(update={"kind": "can"}), **more})
