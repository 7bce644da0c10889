"""The preflight's items by check and name, tried on simulated devices."""

from collections import namedtuple
from dataclasses import replace

from hil.check import items_host
from hil.check.catalogue import checks
from hil.check.checklist import load_checklist
from hil.check.judge import judge

ITEMS = {
    (item.check, str(item.args.get("name", ""))): item
    for group in load_checklist("preflight").group
    for item in group.item
    if item.check
}


def result(context, check, **args):
    """The preflight item's judgement."""
    item = ITEMS[check, args.get("name", "")]
    known = checks()[check]
    return judge(known.function(context, **{**item.args, **args}), item.limits, known.unit)


def with_slot(context, slot, **changes):
    section = getattr(context.rig, slot).model_copy(update=changes)
    return replace(context, rig=context.rig.model_copy(update={slot: section}), _kept={})


def roomy(monkeypatch, gigabytes):
    """Let the disk have so much room: what this machine happens to have left must decide no test."""
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(items_host.shutil, "disk_usage", lambda folder: usage(1e12, 1e12, gigabytes * 1e9))
