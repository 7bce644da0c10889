"""The structure of the project, read from its imports: order of packages, allowed imports, readers of a clock."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.paths import ROOT

# Every package, lowest first: a module imports from its own package and from those that stand before it.
ORDER = """
kernel
scenarios
groundcar.motion groundcar.board groundcar.scout
vehicle.quadrotor vehicle.camera vehicle.render vehicle.apriltag vehicle.mocap
vehicle.px4 vehicle.px4.sim.rows vehicle.px4.sim.services vehicle.px4.sim vehicle.px4.hitl vehicle.px4.driver
vehicle.crazyflie vehicle.crazyflie.sim vehicle.crazyflie.driver
policies.task policies.estimation policies.prediction policies.guidance policies.planner policies.flying
policies.environment policies.gym policies.teachers policies.baselines policies.evaluation
policies.network policies.training.learners policies.training
hil.contract hil.scoring hil.recording hil.safety hil.bus hil.wires hil.nodes hil.faults hil.assembly hil.host
hil.live.messages hil.live
hil.bench hil.check
hil.report.recorded hil.report.drawing hil.report.sections hil.campaign.workers hil.campaign hil.report
hil.viewer hil.viewer.foxglove hil.ros2 hil.results hil.cli hil
"""
FLIES = ("hil.nodes", "hil.assembly", "hil.host", "hil.live", "policies.flying", "vehicle.px4.driver")
TRAINS = ("policies.training", "policies.training.learners", "policies.environment", "policies.network")
LEARNING_LIBRARIES = {"torch", "onnx", "scipy"}
DEVICE_LIBRARIES = {"pymavlink", "cflib", "mavsdk", "zenoh", "pyapriltags", "cv2", "can", "cantools"}
READS_CLOCKS = (
    *("hil.host", "hil.live", "hil.bus", "hil.wires", "hil.bench", "hil.check", "hil.viewer", "hil.cli"),
    *("policies.training.run", "policies.prediction.learned_training"),  # long work that saves and ends by the clock
)
CLOCKS = {"time", "time_ns", "monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns", "sleep", "now", "utcnow"}
MOST_MODULES = 25


@cache
def modules() -> dict[str, Path]:
    """Every module of the product by its dotted name; a package by its own."""
    tops = sorted({name.split(".")[0] for name in ORDER.split()})
    files = [file for top in tops for file in sorted((ROOT / top).rglob("*.py"))]
    return {".".join(f.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): f for f in files}


@cache
def parsed() -> dict[str, ast.Module]:
    return {name: ast.parse(file.read_text(encoding="utf-8")) for name, file in modules().items()}


def imported(tree: ast.AST, known: Iterable[str]) -> Iterator[str]:
    """What a file imports, also inside functions and for type checks only: ours as modules, others as written."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from inner & set(known)
            if inner - set(known):
                yield node.module


@cache
def imports() -> dict[str, frozenset[str]]:
    """Module -> what it imports."""
    return {name: frozenset(set(imported(tree, modules())) - {name}) for name, tree in parsed().items()}


def package(module: str) -> str:
    return module if modules()[module].name == "__init__.py" else module.rpartition(".")[0]


def circles(graph: dict[str, frozenset[str]]) -> list[list[str]]:
    """Groups of modules that import each other (strongly connected components), sorted."""
    reach = {name: reached(graph, [name]) for name in graph}
    groups = {tuple(sorted(m for m in reach[name] if name in reach.get(m, ()))) for name in graph}
    return [list(group) for group in sorted(groups) if group]


def reached(graph: dict[str, frozenset[str]], start: Iterable[str]) -> set[str]:
    """All that is imported from `start` on, `start` itself only where a circle leads back."""
    seen: set[str] = set()
    todo = list(start)
    while todo:
        for name in graph.get(todo.pop(), ()):
            if name not in seen:
                seen.add(name)
                todo.append(name)
    return seen


def libraries(packages: tuple[str, ...]) -> set[str]:
    """Other people's libraries that the modules of these packages reach."""
    found = reached(imports(), [m for m in modules() if package(m) in packages])
    return {name.split(".")[0] for name in found if name not in modules()}


def clock_readings(tree: ast.AST) -> list[int]:
    """Lines that call `time.X` or `datetime.now`."""
    calls = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    return [
        func.lineno
        for func in calls
        if isinstance(func, ast.Attribute)
        and func.attr in CLOCKS
        and isinstance(func.value, ast.Name)
        and func.value.id in ("time", "datetime", "date")
    ]


def test_every_package_with_code_has_a_place_in_the_order():
    with_code = {package(m) for m, file in modules().items() if file.stat().st_size}
    assert with_code <= set(ORDER.split())


def test_no_module_imports_from_a_package_above_its_own():
    rank = {name: i for i, name in enumerate(ORDER.split())}
    upward = [
        f"{module} -> {other}"
        for module, others in imports().items()
        for other in others
        if other in modules() and modules()[other].stat().st_size and rank[package(other)] > rank[package(module)]
    ]
    assert not upward


def test_no_import_circle_between_files():
    assert not circles(imports())


@pytest.mark.parametrize(
    "back",
    [
        ("hil.check.registry", "hil.check.items_camera"),
        ("hil.cli.campaign", "hil.cli.main"),
        ("policies.task.interface", "policies.planner.policy"),
        ("vehicle.px4.sim.view", "vehicle.px4.sim.messages"),
    ],
)
def test_added_import_circle_is_found(back):
    module, other = back
    assert circles({**imports(), module: imports()[module] | {other}})


def test_flight_packages_import_no_learning_library():
    assert not libraries(FLIES) & LEARNING_LIBRARIES


def test_training_reaches_no_device_library():
    assert not libraries(TRAINS) & DEVICE_LIBRARIES


def test_only_hosts_links_and_the_command_line_read_a_clock():
    readers = {f"{m}:{line}" for m, tree in parsed().items() for line in clock_readings(tree)}
    assert not {r for r in readers if not r.startswith(READS_CLOCKS)}


def test_no_folder_holds_too_many_modules():
    counts = Counter(str(file.parent.relative_to(ROOT)) for file in modules().values() if file.name != "__init__.py")
    assert not {folder: count for folder, count in counts.items() if count > MOST_MODULES}
