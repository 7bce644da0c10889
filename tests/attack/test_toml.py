"""Wild values in every key of the files that a user writes: one line that names the file, and no other exception."""

from pathlib import Path

import pytest

from groundcar.scout.params import load_scout
from hil.assembly.rig import RIG_DIR, load_rig
from hil.check.checklist import FOLDER as CHECKLISTS
from hil.check.checklist import load_checklist
from kernel.toml_errors import ConfigError
from policies.training.recipe import FOLDER as RECIPES
from policies.training.recipe import RecipeError, load_recipe
from scenarios.draw import draw
from scenarios.spec import FOLDER as SCENARIOS
from scenarios.spec import load
from tests.attack.forged import FACTOR, damaged, rng
from vehicle.quadrotor.airframe import AIRFRAME_DIR, load_airframe

WILD = (
    "nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "0", "-1", "1", "9223372036854775807", "1" + "0" * 400,
    '"0.5"', '""', "true", "[]", "[[]]", "[1, 2]", "[2.0, 1.0]", "{}", "{ a = 1 }", "1979-05-27", "'../../..'", "0.5",
)  # fmt: skip


def fly(path):
    """A scenario that is accepted can also be drawn."""
    scenario = load(path)
    for seed in (0, 1):
        draw(scenario, seed)


READERS = {
    "scenario": (SCENARIOS / "hard_ii.toml", fly),
    "line": (SCENARIOS / "simple_ii.toml", fly),
    "rig": (RIG_DIR / "field.toml", lambda path: load_rig(str(path))),
    "airframe": (AIRFRAME_DIR / "paper_quad.toml", load_airframe),
    "checklist": (CHECKLISTS / "preflight.toml", lambda path: load_checklist(str(path))),
    "recipe": (sorted(RECIPES.glob("*.toml"))[0], load_recipe),
    "car": (Path(load_scout.__code__.co_filename).with_name("scout_mini.toml"), load_scout),
}


def lines(text):
    """Numbers of the lines that set a key."""
    return [i for i, line in enumerate(text.splitlines()) if "=" in line and line[0] not in "#[ "]


def refused_or_read(read, path):
    try:
        read(path)
    except (ConfigError, RecipeError, ValueError) as error:
        assert type(error) in (ConfigError, RecipeError), repr(error)
        assert path.stem in str(error)


@pytest.mark.parametrize("kind", READERS)
def test_wild_value_of_a_key_is_refused_by_name_or_read(kind, tmp_path):
    source, read = READERS[kind]
    text, random_, path = source.read_text(), rng(kind), tmp_path / "mine.toml"
    path.write_text(text)
    read(path)
    for number in random_.sample(lines(text), min(12 * FACTOR, len(lines(text)))):
        for wild in random_.sample(WILD, min(6 * FACTOR, len(WILD))):
            rows = text.splitlines()
            rows[number] = f"{rows[number].partition('=')[0]}= {wild}"
            path.write_text("\n".join(rows))
            refused_or_read(read, path)


@pytest.mark.parametrize("kind", READERS)
def test_damaged_file_is_refused_or_read(kind, tmp_path):
    source, read = READERS[kind]
    path, random_ = tmp_path / "mine.toml", rng(f"damaged {kind}")
    for _ in range(25 * FACTOR):
        path.write_bytes(damaged(source.read_bytes(), random_))
        refused_or_read(read, path)
    for deep in ("x = " + "[" * 5000, "x = " + "{a=" * 5000, "[" + "a." * 5000 + "a]"):
        path.write_text(deep)
        with pytest.raises((ConfigError, RecipeError)):
            read(path)
