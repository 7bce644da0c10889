"""A typo anywhere in a file names file, place, key and what is allowed there."""

from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field, model_validator

from kernel.toml_errors import ConfigError, load_toml, place, validate


class Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Circle(Table):
    kind: Literal["circle"]
    radius: float


class Line(Table):
    kind: Literal["line"]
    length: float
    ends: tuple[float, float] = (0.0, 1.0)


class Options(Table):
    colour: str = "red"


class Part(Table):
    size: float = 1.0
    limit: bool | int | float | None = None
    options: Options | None = None
    shape: Annotated[Circle | Line, Field(discriminator="kind")] | None = None

    @model_validator(mode="after")
    def _small(self):
        if self.size > 10:
            raise ValueError("a part is at most 10 m")
        return self


class Box(Table):
    title: str
    part: tuple[Part, ...] = Field(default=(), min_length=1)
    shape: list[Annotated[Circle | Line, Field(discriminator="kind")]] = []
    by_name: dict[str, Part] = {}


class Store(Table):
    owner: str = ""
    box: list[Box] = []


FAULTS = [
    (
        'title = "b"\n[[box.part]]\nsiz = 1',
        'box 1 "b", part 1: unknown key "siz"; did you mean "size"? Allowed: limit, ',
    ),
    ('title = "b"\n[[box.part]]\n[[box.part]]\nsize = "x"', 'box 1 "b", part 2: key "size": must be a valid number'),
    ('title = "b"\n[[box.part]]\nsize = 11', 'box 1 "b", part 1: a part is at most 10 m'),
    ('title = "b"\n[[box.part]]\nlimit = "x"', 'box 1 "b", part 1: key "limit": must be'),
    (
        'title = "b"\n[[box.part]]\noptions = { color = "blue" }',
        'box 1 "b", part 1: unknown key "options.color"; did you mean "colour"? Allowed in options: colour',
    ),
    (
        'title = "b"\n[[box.part]]\nshape = { kind = "circle", radios = 1.0 }',
        'part 1: unknown key "shape.radios"; did you mean "radius"? Allowed in shape: kind, radius',
    ),
    (
        'title = "b"\n[[box.shape]]\nkind = "circl"',
        'box 1 "b", shape 1: key "kind" is "circl"; did you mean "circle"? Allowed: circle, line',
    ),
    (
        'title = "b"\n[[box.shape]]\nkind = "line"\nlenght = 1.0',
        'shape 1: unknown key "lenght"; did you mean "length"?',
    ),
    ('title = "b"\n[[box.shape]]\nlength = 1.0', 'box 1 "b", shape 1: key "kind" is missing'),
    ('title = "b"\n[[box.shape]]\nkind = "line"\nlength = 1.0\nends = [1.0, "x"]', 'shape 1: key "ends.1": must be'),
    ("", 'box 1: key "title" is missing'),
    ('titel = "b"', 'box 1: unknown key "titel"; did you mean "title"? Allowed: by_name, part, shape, title'),
    ('title = "b"\n[[box]]\ntitle = "c"\nparts = 3', 'box 2 "c": unknown key "parts"; did you mean "part"?'),
    ('title = "b"\n[box.by_name.left]\nsiz = 1', 'box 1 "b": unknown key "by_name.left.siz"; did you mean "size"?'),
    ('title = "b"\npart = 3', 'box 1 "b": key "part": must be'),
]


@pytest.mark.parametrize(("text", "message"), FAULTS, ids=[message for _, message in FAULTS])
def test_a_fault_in_an_array_of_tables_is_named(tmp_path, text, message):
    path = tmp_path / "mine.toml"
    path.write_text(f"[[box]]\n{text}\n")
    with pytest.raises(ConfigError) as error:
        load_toml(path, Store)
    lines = str(error.value).splitlines()
    assert any(line.startswith(f"{path}: ") and message in line for line in lines), lines


def test_an_array_is_not_called_short_for_the_faults_within_it():
    for parts, expected in (([{"siz": 1}], "unknown key"), ([], "at least 1 item")):
        with pytest.raises(ConfigError, match=expected) as error:
            validate({"title": "b", "part": parts}, Box, "here")
        assert str(error.value).count("here:") == 1


def test_errors_outside_arrays_are_unchanged(tmp_path):
    with pytest.raises(
        ConfigError, match=r'^here: unknown key "ovner"; did you mean "owner"\? Allowed in the top level: '
    ):
        validate({"ovner": 1}, Store, "here")


def test_nearest_gives_a_full_stop_without_a_close_word():
    with pytest.raises(ConfigError, match=r'unknown key "zzz"\. Allowed in the top level: '):
        validate({"zzz": 1}, Store, "here")


@given(st.integers(0, 5), st.integers(0, 5), st.text("abcxyz", min_size=1, max_size=6))
def test_place_counts_from_one(box, part, key):
    if key in Part.model_fields:
        return
    parts = [{} for _ in range(part)] + [{key: 1}]
    boxes = [{"title": f"t{i}"} for i in range(box)] + [{"title": "last", "part": parts}]
    with pytest.raises(ConfigError) as error:
        validate({"box": boxes}, Store, "here")
    assert str(error.value).startswith(f'here: box {box + 1} "last", part {part + 1}: unknown key "{key}"')


@pytest.mark.parametrize(
    ("data", "location", "expected"),
    [
        ({}, (), ""),
        ({"a": 1}, ("a",), ""),
        ({"a": [{"name": "n"}]}, ("a", 0), 'a 1 "n"'),
        ({"a": [1]}, ("a", 0), "a 1"),
        ({}, ("a", 2, "b", 0), "a 3, b 1"),
    ],
)
def test_place_names_arrays_and_titles(data, location, expected):
    assert place(data, location) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('title = "b"\n[[part]]\nsize = "1.5"', "part 1: key \"size\": must be a valid number, but it is '1.5'"),
        ('title = "b"\n[[part]]\nsize = true', 'part 1: key "size": must be a valid number'),
        ("title = 3\n[[part]]", 'key "title": must be a valid string'),
        ('title = "b"\n[[part]]\nsize = 1979-05-27', "holds a value that no key takes"),
        ("title = " + "[" * 5000 + "]" * 5000, "nested more than 64 deep"),
        ("title = " + "[" * 70 + "]" * 70, "nested more than 64 deep"),
        ("[" + ".".join("a" * 70) + "]\nx = 1", "nested more than 64 deep"),
        ("title = " + "9" * 5000, "not valid TOML: "),
        ('title = "' + "x" * (1 << 20) + '"', "is larger than 1 MB"),
        ("title = 'a\x00b'", "not valid TOML: "),
    ],
    ids=lambda text: text[:30],
)
def test_strange_file_is_refused_with_one_line(tmp_path, text, message):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_toml(path, Box)
    assert str(error.value).startswith(f"{path}: ")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_path_that_is_none_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="is no path of a file"):
        load_toml(tmp_path / "a\0b.toml", Box)
    with pytest.raises(ConfigError, match="cannot be read: Is a directory"):
        load_toml(tmp_path, Box)
