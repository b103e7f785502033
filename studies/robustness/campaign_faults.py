"""Damaged campaigns: one fault or some in campaign.yaml, as a document or as bytes, or in the files beside it.

And campaigns written in another way that means the same, which nothing may refuse or read otherwise.
"""

import copy
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

Document = dict[str, Any]

_VALUES: tuple[Any, ...] = (
    float("nan"), float("inf"), -float("inf"), -1, 0, -0.0, 1e-12, 1e12, 10**30, "", "text", "1,5", None, True, [], {},
    [[]], [None], {"a": 1}, "{{ }}", "../../../etc/passwd", "/dev/zero", "/etc/hostname", "..", ".", "/", "$x^$",
    "board_**", "**/*", "/**/*.jpg", "a\0b", "a\nb", "\u202etxt", "ü", "[", "*", "~", "<script>alert(1)</script>",
    "x" * 300, "x" * 100_000, [0] * 3000, list(range(50)), "2024-13-45", "0x10", "1e400",
)  # fmt: skip
_SNIPPETS = (
    "\n? [1, 2]\n: 3\n", "\n1: 2\n", "\ntrue: 1\n", "\n~: 1\n", "\n{{ }}: 1\n", "\nx: !!python/object:os.system {}\n",
    "\nx: !!int no\n", "\nx: 2024-13-45\n", "\nx: !!timestamp 2024-13-45\n", "\nx: &a [*a]\n", "\nx: *nowhere\n",
    "\ncamera: 1\n", "\n\tx: 1\n", "\n---\nx: 1\n", "\n...\n", "\x00", "\ufeff", "\n" + "[" * 5000, "\n- " * 3,
    "\nx: " + "9" * 6000 + "\n", "\n" + "".join(f"k{i}: 1\n" for i in range(20_000)),
    "\na0: &a0 [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
        f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)),
    "\n<<: {camera: 1}\n", "\ngravity_m_per_s2: .nan\n", "\nx: !!binary x\n", "\nx: !!set {a}\n",
)  # fmt: skip


def places(document: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values of a document, outer ones included."""
    found = [at] if at else []
    items = (
        document.items() if isinstance(document, dict) else enumerate(document) if isinstance(document, list) else ()
    )
    for key, value in items:
        found += places(value, (*at, key))
    return found


def damaged_document(document: Document, rng: np.random.Generator) -> Document:
    """A copy with one to three of its values gone, doubled, renamed, scaled, of another kind, or swapped."""
    new = copy.deepcopy(document)
    for _ in range(rng.integers(1, 4)):
        all_places = places(new)
        if not all_places:
            break
        *way, last = all_places[rng.integers(len(all_places))]
        parent = new
        for key in way:
            parent = parent[key]
        _FAULTS[rng.integers(len(_FAULTS))](parent, last, rng)
    return new


def _remove(parent: Any, key: Any, _rng: np.random.Generator) -> None:
    del parent[key]


def _replace(parent: Any, key: Any, rng: np.random.Generator) -> None:
    parent[key] = copy.deepcopy(_VALUES[rng.integers(len(_VALUES))])


def _scale(parent: Any, key: Any, rng: np.random.Generator) -> None:
    if isinstance(parent[key], int | float) and not isinstance(parent[key], bool):
        parent[key] = float(parent[key] * 10.0 ** rng.uniform(-6, 6) * rng.choice([1, 1, 1, -1]))


def _double(parent: Any, key: Any, _rng: np.random.Generator) -> None:
    if isinstance(parent, list):
        parent.insert(key, copy.deepcopy(parent[key]))
    else:
        parent[f"{key}_"] = copy.deepcopy(parent[key])


def _shorten(parent: Any, key: Any, rng: np.random.Generator) -> None:
    if isinstance(parent[key], list) and parent[key]:
        parent[key] = parent[key][: rng.integers(len(parent[key]))]


def _swap(parent: Any, key: Any, rng: np.random.Generator) -> None:
    keys = list(parent) if isinstance(parent, dict) else list(range(len(parent)))
    other = keys[rng.integers(len(keys))]
    parent[key], parent[other] = parent[other], parent[key]


_FAULTS: tuple[Callable[[Any, Any, np.random.Generator], None], ...] = (
    _remove, _replace, _replace, _scale, _scale, _double, _shorten, _swap,
)  # fmt: skip


def damaged_text(text: bytes, rng: np.random.Generator) -> bytes:
    """The bytes of a document with a bit flipped, a part gone or doubled, cut off, in another code, or with more."""
    kind, at = rng.integers(7), int(rng.integers(len(text)))
    until = at + int(rng.integers(1, 200))
    if kind == 0:
        return text[:at] + bytes([text[at] ^ 1 << int(rng.integers(8))]) + text[at + 1 :]
    if kind == 1:
        return text[:at] + text[until:]
    if kind == 2:
        return text[:until] + text[at:]
    if kind == 3:
        return text[:at]
    if kind == 4:
        return text.decode().encode(("utf-16", "latin-1", "utf-32", "cp037")[rng.integers(4)], errors="replace")
    snippet = _SNIPPETS[rng.integers(len(_SNIPPETS))].encode()
    return text + snippet if kind == 5 else text[:at] + snippet + text[at:]


def rewritten_document(document: Document, rng: np.random.Generator) -> bytes:
    """The text of the same document with its keys in another order, as JSON, in flow or block style, or indented."""
    shuffled = _shuffled(document, rng)
    kind = rng.integers(5)
    if kind == 0:
        return json.dumps(shuffled, indent=(None, 1, 4)[rng.integers(3)], ensure_ascii=bool(rng.integers(2))).encode()
    return yaml.safe_dump(
        shuffled,
        sort_keys=False,
        allow_unicode=True,
        default_flow_style=(None, True, False)[rng.integers(3)],
        default_style=None if kind < 4 else "",
        indent=int(rng.integers(2, 9)),
        width=int(rng.choice([20, 80, 10_000])),
        explicit_start=bool(rng.integers(2)),
        explicit_end=bool(rng.integers(2)),
    ).encode()


def _shuffled(value: Any, rng: np.random.Generator) -> Any:
    """A copy with the keys of every mapping in another order and some whole numbers written as 25.0."""
    if isinstance(value, dict):
        return {key: _shuffled(value[key], rng) for key in rng.permutation(np.array(list(value), dtype=object))}
    if isinstance(value, list):
        return [_shuffled(item, rng) for item in value]
    return float(value) if type(value) is int and rng.integers(2) else value


def rewritten_text(text: bytes, rng: np.random.Generator) -> bytes:
    """The same text with other ends of lines, a byte order mark, or comments and blank lines between its lines."""
    lines = text.decode().splitlines()
    if rng.integers(2) and not text.lstrip().startswith(b"{"):
        ends = ("", "  # 0.5: a remark", "\t", "   ")
        lines = [line + ends[rng.integers(4)] for line in lines]
        lines = [part for line in lines for part in ([line, "# x: [1", ""] if rng.integers(9) == 0 else [line])]
    end = ("\n", "\r\n", "\r")[rng.integers(3)]
    return (b"\xef\xbb\xbf" if rng.integers(3) == 0 else b"") + end.join(lines).encode() + end.encode()


def write_rewritten(source: Path, folder: Path, rng: np.random.Generator) -> str:
    """Write a copy of a campaign into ``folder`` that means the same and is written in another way; say how."""
    _link_files(source, folder)
    text = (source / "campaign.yaml").read_bytes()
    kind = ("lines alone", "document", "document")[rng.integers(3)]
    if kind == "document":
        text = rewritten_document(yaml.safe_load(text), rng)
    (folder / "campaign.yaml").write_bytes(rewritten_text(text, rng))
    return kind


def _link_files(source: Path, folder: Path) -> None:
    for path in sorted(source.rglob("*")):
        copy_of = folder / path.relative_to(source)
        if path.is_dir():
            copy_of.mkdir(parents=True, exist_ok=True)
        elif path.name != "campaign.yaml":
            copy_of.symlink_to(path.resolve())


def write_damaged(source: Path, folder: Path, rng: np.random.Generator) -> str:
    """Write a damaged copy of a campaign into ``folder`` and say how; its own files are linked, not copied."""
    _link_files(source, folder)
    text = (source / "campaign.yaml").read_bytes()
    kind = ("document", "document", "document", "text", "files")[rng.integers(5)]
    if kind == "document":
        new = damaged_document(yaml.safe_load(text), rng)
        text = yaml.safe_dump(new, allow_unicode=True, sort_keys=False).encode()
    elif kind == "text":
        text = damaged_text(text, rng)
    (folder / "campaign.yaml").write_bytes(text)
    return f"{kind}: {_damage_file(folder, rng)}" if kind == "files" else kind


def _damage_file(folder: Path, rng: np.random.Generator) -> str:
    files = sorted(path for path in folder.rglob("*") if not path.is_dir())
    path = files[rng.integers(len(files))]
    data = path.read_bytes()
    path.unlink()
    kind = ("missing", "dangling", "loop", "pipe", "folder", "empty", "cut", "device", "locked", "outside")[
        rng.integers(10)
    ]
    if kind == "dangling":
        path.symlink_to("nowhere")
    elif kind == "loop":
        path.symlink_to(path.name)
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "cut":
        path.write_bytes(data[: rng.integers(len(data))])
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "locked":
        path.write_bytes(data)
        path.chmod(0)
    elif kind == "outside":
        path.symlink_to("/etc/hostname")
    return f"{path.name} {kind}"


def removed(folder: Path) -> None:
    """Remove a damaged campaign, whatever it holds."""
    shutil.rmtree(folder, ignore_errors=True)
