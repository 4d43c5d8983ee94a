"""What the command line prints and writes: progress, tables, JSON and errors."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from limitray.scene import Scene


def version() -> str:
    """Name and version of the package."""
    return f"limitray {metadata.version('limitray')}"


def fail(message: str, code: int) -> int:
    """Prints one line to stderr; returns `code`."""
    print("limitray: " + " ".join(message.split()), file=sys.stderr)
    return code


def check_writable(path: Path) -> None:
    """Raises OSError unless `path` can be written; leaves no file behind."""
    existed = path.exists()
    with path.open("ab"):
        pass
    if not existed:
        path.unlink()


@contextmanager
def progress(label: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on stderr if it is a terminal; yields a function of (done, total)."""
    console = Console(stderr=True)
    bar = Progress(
        TextColumn(label),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    with bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def print_render(
    output: Path, scene: Scene, seconds: float, interrupted: bool, stats: bool, as_json: bool
) -> None:
    """What `render` did: one line, or with `stats` a table, or JSON."""
    counters = scene.statistics()
    mesh = scene.mesh_statistics(0)
    rate = counters["rays"] / seconds
    facts = {
        "output": str(output),
        "interrupted": interrupted,
        "seconds": seconds,
        "rays_per_second": rate,
        "isa": scene.isa(),
        "device": scene.device_name(),
        "mesh": mesh,
        "statistics": counters,
    }
    if as_json:
        print(json.dumps(facts, indent=2))
        return
    if stats:
        rows = {
            "patches": f"{mesh['patches']:,} ({mesh['gregory_patches']:,} Gregory)",
            "build": f"{mesh['build_seconds']:.3f} s",
            "memory": _bytes(mesh["patch_bytes"] + mesh["bvh_bytes"]),
            "instruction set": scene.isa(),
            "device": scene.device_name(),
            "render": f"{seconds:.2f} s",
            "rays a second": f"{rate / 1e6:.2f} million",
            **{name.replace("_", " "): f"{count:,}" for name, count in counters.items()},
        }
        _print_table(rows)
    if counters["unresolved"]:
        fail(f"{counters['unresolved']} rays did not reach the precision limit", 0)
    print(f"{output}{' (stopped early)' if interrupted else ''}")


def print_cast(output: Path, rays: int, hits: int, seconds: float, as_json: bool) -> None:
    """What `cast` did: one line, or JSON."""
    if as_json:
        facts = {"output": str(output), "rays": rays, "hits": hits, "seconds": seconds}
        print(json.dumps(facts, indent=2))
    else:
        print(f"{output}: {hits:,} of {rays:,} rays hit, {seconds:.2f} s")


def print_info(model: Path, facts: dict[str, Any]) -> None:
    """The facts of `limitray.mesh_info` as a table, warnings below."""
    rows = {"model": str(model)}
    for name, value in facts.items():
        if name == "extent" and value is not None:
            rows["extent"] = " to ".join(str([float(f"{x:.6g}") for x in row]) for row in value)
        elif name.endswith("bytes"):
            rows[name.replace("bytes", "memory").replace("_", " ")] = _bytes(value)
        elif name == "build_seconds":
            rows["build"] = f"{value:.3f} s"
        elif name != "warnings":
            rows[name.replace("_", " ")] = _text(value)
    _print_table(rows)
    for warning in facts["warnings"]:
        print(f"warning: {warning}")


def _print_table(rows: dict[str, str]) -> None:
    width = max(map(len, rows))
    for name, value in rows.items():
        print(f"{name:<{width}}  {value}")


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}: {count:,}" for key, count in value.items()) or "none"
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    return f"{value:,}" if isinstance(value, int) else str(value)


def _bytes(count: int) -> str:
    return f"{count / 1024:,.1f} KiB" if count < 1 << 20 else f"{count / (1 << 20):,.1f} MiB"
