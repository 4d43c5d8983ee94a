"""`limitray bench --device`: a GPU against the CPU on one model, through the Python interface."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from limitray.camera import Camera
from limitray.gpu_tracer import import_slangpy
from limitray.models import load_model
from limitray.scene import Scene

Report = dict[str, Any]
Rays = NDArray[np.float32]
RESIDENT = "GPU, rays and answers on it"
MOVED = "GPU, arrays of the host"
CPU = "CPU"


def measure_device(
    model: Path,
    device: str,
    rays: int,
    rounds: int,
    threads: int,
    isolation_level: int | None,
    tolerance: float | None = None,
) -> Report:
    """Traces the same rays on the CPU and on a GPU, in turns; medians of `rounds`.

    About `rays` primary rays of a camera, which the GPU makes itself, and as many diffuse rays that
    leave what these hit. Hits are compared before anything is timed.
    """
    cpu, gpu = (
        load_model(
            model,
            isolation_level=isolation_level,
            tolerance=tolerance,
            threads=threads,
            device=name,
        )
        for name in ("cpu", device)
    )
    camera = Camera.frame(cpu, aspect=1)
    side = max(1, round(np.sqrt(rays)))
    y, x = np.indices((side, side)) + 0.5
    primary = camera.rays(x, y, side, side).astype(np.float32).reshape(-1, 6)
    diffuse = diffuse_rays(cpu, primary, len(primary))
    statistics = cpu.mesh_statistics(0)
    report: Report = {
        "model": str(model),
        "device": gpu.device_name(),
        "patches": statistics["patches"],
        "isolation_level": statistics["isolation_level"],
        "rows": [],
    }
    slangpy = import_slangpy()
    for kind, batch in (("primary", primary), ("diffuse", diffuse)):
        resident = slangpy.Tensor.from_numpy(gpu.gpu_device, batch)
        ways: dict[str, Callable[[], Any]] = {
            RESIDENT: partial(gpu.cast_camera_rays, camera, side, side, output="device")
            if kind == "primary"
            else partial(gpu.cast_rays, resident, output="device"),
            MOVED: partial(gpu.cast_rays, batch),
            CPU: partial(cpu.cast_rays, batch),
        }
        wrong = mismatches(cpu, gpu, batch)
        seconds: dict[str, list[float]] = {way: [] for way in ways}
        for _ in range(rounds):
            for way, cast in ways.items():
                start = time.perf_counter()
                cast()
                gpu.gpu_device.wait_for_idle()
                seconds[way].append(time.perf_counter() - start)
        for way in ways:
            report["rows"].append(
                {
                    "tracer": way,
                    "rays": kind,
                    "count": len(batch),
                    "mrays_per_s": len(batch) / float(np.median(seconds[way])) / 1e6,
                    "mismatches": 0 if way == CPU else wrong,
                }
            )
    return report


def diffuse_rays(scene: Scene, rays: Rays, count: int, seed: int = 0) -> Rays:
    """`count` cosine-distributed rays that leave the hits of `rays` on the side of the viewer."""
    rng = np.random.default_rng(seed)
    hits = scene.cast_rays(rays, attributes=("points", "t_error"))
    found = np.flatnonzero(np.isfinite(hits["t_hit"]))
    if len(found) == 0:
        raise ValueError("the camera sees no surface")
    chosen = rng.choice(found, count)
    normals = hits["primitive_normals"][chosen]
    normals *= -np.copysign(1, (normals * rays[chosen, 3:]).sum(axis=1, keepdims=True))
    directions = rng.normal(size=normals.shape)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True) + normals
    size = np.ptp(scene.bounds(), axis=0).max()
    made = np.concatenate([hits["points"][chosen] + 1e-4 * size * normals, directions], axis=1)
    return made.astype(np.float32)


def mismatches(cpu: Scene, gpu: Scene, rays: Rays) -> int:
    """Rays that hit on one only, or farther apart than the error bounds of both allow."""
    a, b = (scene.cast_rays(rays, attributes=("t_error",)) for scene in (cpu, gpu))
    hit = np.isfinite(a["t_hit"])
    wrong = hit != np.isfinite(b["t_hit"])
    both = hit & ~wrong
    error = a["t_error"][both] + b["t_error"][both]
    wrong[both] = np.abs(a["t_hit"][both] - b["t_hit"][both]) > error
    return int(wrong.sum())


def print_device_report(report: Report) -> None:
    """Prints what was measured as a table."""
    print(f"{report['model']}: {report['patches']:,} patches; GPU: {report['device']}")
    table = Table(box=box.SIMPLE)
    for name in ("rays", "count", "tracer", "Mray/s", "mismatches with the CPU"):
        table.add_column(name, justify="left" if name in ("rays", "tracer") else "right")
    for row in report["rows"]:
        rate, count = f"{row['mrays_per_s']:.3g}", f"{row['count']:,}"
        table.add_row(row["rays"], count, row["tracer"], rate, f"{row['mismatches']:,}")
    console = Console()
    console.width = max(console.width, 90)
    console.print(table)
