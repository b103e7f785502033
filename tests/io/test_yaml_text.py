"""YAML within bounds: what would unfold, nest, hang or mean something else than it says is refused in one message."""

import os
import time

import pytest

from towval.io.schema import check
from towval.io.yaml_text import MOST_BYTES, read_value, read_yaml
from towval.model.errors import InputError

NINE = "[" + ",".join("x" * 9) + "]"
BOMB = f"a0: &a0 {NINE}\n" + "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 30))

REFUSED = {
    "bomb": BOMB,
    "bomb of merges": "a0: &a0 {k: 1}\n" + "".join(
        f"a{i}: &a{i} {{<<: [{','.join([f'*a{i - 1}'] * 9)}], k{i}: 1}}\n" for i in range(1, 30)),
    "many keys": "".join(f"k{i}: 1\n" for i in range(60_000)),
    "deep": "[" * 100_000,
    "deep block": "- " * 5000,
    "refers to itself": "&a [*a]",
    "key is a mapping": "{{ }}",
    "key is a list": "? [1]\n: 2",
    "key twice": "a: 1\na: 2",
    "number too long": "9" * 5000,
    "tag that does not fit": "!!int x",
    "date that is none": "!!timestamp 2024-13-45",
    "object": "!!python/object/apply:os.system [true]",
    "binary that is none": "!!binary x",
    "control sign": "a: \x01",
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_one_message_at_once(name):
    begun = time.process_time()
    with pytest.raises(InputError, match="not valid YAML") as error:
        read_value(REFUSED[name])
    assert time.process_time() - begun < 2
    assert len(str(error.value)) < 500


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("{1: a, True: b, 1.5: c, ~: d, 010: e}", {"1": "a", "True": "b", "1.5": "c", "~": "d", "010": "e"}),
        ("2024-13-45", "2024-13-45"),
        ("2024-01-01", "2024-01-01"),
        ("[010, 1:30, 0x1F]", ["010", "1:30", "0x1F"]),
        ("[0, -3, +4, 1_000, 1e-7, .5, 2., -1.5e3]", [0, -3, 4, 1000, 1e-7, 0.5, 2.0, -1500.0]),
        ("x: &x {a: 1, b: 2}\ny: {<<: *x, b: 3}", {"x": {"a": 1, "b": 2}, "y": {"a": 1, "b": 3}}),
    ],
)
def test_keys_are_texts_and_numbers_are_decimal(text, value):
    assert read_value(text) == value


@pytest.mark.parametrize("text", ["a:\n\tb: 1\n", "a:\n  b: 1\n \tc: 2\n"])
def test_a_tab_in_the_indentation_is_named(text, tmp_path):
    (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(InputError, match="indent with spaces, not tabs"):
        read_yaml(tmp_path / "x.yaml")


def test_a_windows_path_between_double_quotes_is_told(tmp_path):
    (tmp_path / "x.yaml").write_text('video: "C:\\Videos\\a.mp4"\n')
    with pytest.raises(InputError, match="write / in paths"):
        read_yaml(tmp_path / "x.yaml")


@pytest.mark.parametrize(("value", "shown"), [("svg", r"a list, as \[svg\]$"), ("[svg", "a list$"), (5, "a list$")])
def test_a_list_is_shown_as_it_is_written(value, shown):
    with pytest.raises(InputError, match=rf"formats is .*; allowed: {shown}"):
        check({"formats": value}, {"properties": {"formats": {"type": "array"}}}, "report")


def test_a_key_without_a_value_is_empty():
    with pytest.raises(InputError, match="a is empty; allowed: a number"):
        check({"a": None}, {"properties": {"a": {"type": "number"}}}, "the settings")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_a_number_that_is_none_is_named_by_its_key(value):
    schema = {"type": "object", "properties": {"mass_kg": {"type": "number", "description": "Mass", "maximum": 5}}}
    with pytest.raises(InputError, match=r"mass_kg is .*allowed: a finite number"):
        check({"mass_kg": value}, schema, "campaign.yaml")


def test_many_faults_are_counted_and_cut(tmp_path):
    schema = {"type": "object", "properties": {"a": {}}, "additionalProperties": False}
    with pytest.raises(InputError) as error:
        check({f"k\n{i}" * 100: 1 for i in range(5000)}, schema, "campaign.yaml")
    assert len(str(error.value)) < 10_000
    assert len(str(error.value).splitlines()) < 60


def test_what_is_no_plain_file_is_refused_without_reading(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "folder.yaml").mkdir()
    (tmp_path / "dangling.yaml").symlink_to("nowhere")
    (tmp_path / "loop.yaml").symlink_to("loop.yaml")
    (tmp_path / "device.yaml").symlink_to("/dev/zero")
    with (tmp_path / "long.yaml").open("wb") as stream:
        stream.truncate(MOST_BYTES + 1)
    for name in ("pipe", "folder", "dangling", "loop", "device", "long", "none", "x" * 300, "a\0b"):
        with pytest.raises(InputError, match=r"\.yaml"):
            read_yaml(tmp_path / f"{name}.yaml")
