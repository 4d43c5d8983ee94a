"""`limitray bench`: limitray against Embree on one model, as a table, a plot and JSON.

The work is done by the program limitray_bench, installed beside this file's compiled neighbour:
Embree's tessellated peers are linked into it alone. docs/performance.md says what is measured.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from limitray import _core, cli_output
from limitray.bench_device import measure_device, print_device_report
from limitray.cli_options import PrimOption, ToleranceOption, check_device, check_level
from limitray.mesh import Mesh
from limitray.obj import write_obj

Report = dict[str, Any]
TABLE_WIDTH = 124
DEFAULT_LEVEL = 4
COLUMNS = (
    "tracer",
    "Mray/s",
    "a CPU second",
    "limitray is",
    "build",
    "memory",
    "mean error",
    "max error",
    "mismatches",
)


def _parse_count(text: str) -> int:
    """A positive whole number such as "200000" or "1e6"."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not (1 <= number <= 1e9 and number.is_integer()):
        raise typer.BadParameter(f'"{text}" is not a whole number from 1 to 1e9')
    return int(number)


def bench_command(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Cage: .obj or a USD file.")],
    prim: PrimOption = None,
    threads: Annotated[int, typer.Option(min=0, max=4096, help="Threads; 0 takes all cores.")] = 0,
    isolation_level: Annotated[
        int | None,
        typer.Option(min=1, max=10, help="How deep irregular features are isolated.  [default: 4]"),
    ] = None,
    tolerance: ToleranceOption = None,
    rays: Annotated[
        Any, typer.Option(metavar="N", parser=_parse_count, help="Rays of each kind.")
    ] = "1e6",
    rounds: Annotated[int, typer.Option(min=1, help="Interleaved repetitions; medians count.")] = 7,
    tracers: Annotated[
        str,
        typer.Option(
            metavar="A,B,..",
            help="What to compare with: embree-subdivision-N (tessellation rate), "
            "embree-triangles-N (N x N quads a patch), embree-geometry. Default: rates 4, 8, 16, "
            "32, quads 4, 8, 16, and embree-geometry.",
        ),
    ] = "",
    device: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="gpu, vulkan, cuda or metal: measure that GPU against the CPU, not against Embree "
            "(needs limitray[gpu]).",
        ),
    ] = "cpu",
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the figures as JSON.")
    ] = None,
    plot_file: Annotated[
        Path | None,
        typer.Option(
            "--plot", metavar="FILE.png", help="Also plot speed and memory over error (matplotlib)."
        ),
    ] = None,
) -> None:
    """Measures limitray against Embree on MODEL: speed, memory, build time, error.

    Traces the same rays with limitray, with Embree's subdivision geometry and with triangles made
    of every patch, in turns: primary rays of a camera, and diffuse rays that leave what these hit.
    With --device gpu it measures the same rays on a GPU and on the CPU.

    Examples:

        limitray bench spot.obj

        limitray bench spot.obj --rays 2e5 --rounds 3 --threads 1 --json spot.json --plot spot.png
    """
    if plot_file is not None:
        if plot_file.suffix.lower() not in (".png", ".svg", ".pdf"):
            raise typer.BadParameter(
                f'"{plot_file}" does not end in .png, .svg or .pdf', param_hint="--plot"
            )
        _import_matplotlib()
    check_level(isolation_level, tolerance)
    if isolation_level is None and tolerance is None:
        isolation_level = DEFAULT_LEVEL
    check_device(device)
    if device != "cpu" and (tracers or plot_file is not None):
        raise typer.BadParameter("are for --device cpu", param_hint="--tracers and --plot")
    for file in (json_file, plot_file):
        if file is not None:
            cli_output.check_writable(file)
    if device != "cpu":
        figures = measure_device(model, device, rays, rounds, threads, isolation_level, tolerance)
        if json_file is not None:
            json_file.write_text(json.dumps(figures, indent=2) + "\n")
        print_device_report(figures)
        return
    precise = (
        ("--isolation-level", isolation_level) if tolerance is None else ("--tolerance", tolerance)
    )
    options = ["--threads", str(threads), *map(str, precise)]
    options += ["--rays", str(rays), "--rounds", str(rounds)]
    options += ["--tracers", tracers] if tracers else []
    report = measure(model, options, prim)
    if json_file is not None:
        json_file.write_text(json.dumps(report, indent=2) + "\n")
    if plot_file is not None:
        plot(report, plot_file)
    print_report(report)


def measure(model: Path, options: list[str], prim: str | None = None) -> Report:
    """Runs limitray_bench on a cage, or one mesh of a USD file; returns what it reports."""
    with model.open("rb"), tempfile.TemporaryDirectory() as folder:
        cage = model
        if prim is not None or model.suffix.lower() != ".obj":
            cage = Path(folder) / f"{model.stem}.obj"
            write_obj(Mesh.from_file(model, prim), cage)
        result = Path(folder) / "report.json"
        _run([str(_program()), str(cage), *options, "--json", str(result)])
        report: Report = json.loads(result.read_text())
    return {**report, "model": str(model)}


def _program() -> Path:
    program = Path(_core.__file__).with_name("limitray_bench")
    if not program.exists():
        raise FileNotFoundError(2, "not installed: build with LIMITRAY_BENCH=ON", str(program))
    return program


def _run(command: list[str]) -> None:
    """Runs the program; shows its progress on a terminal; raises its complaint as ValueError."""
    console = Console(stderr=True)
    line = ""
    with (
        console.status("") as status,
        subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as process,
    ):
        assert process.stderr is not None
        for line in process.stderr:
            line = line.strip().removeprefix("limitray_bench: ")
            status.update(line)
    if process.returncode == 2:
        raise typer.BadParameter(line)
    if process.returncode != 0:
        raise ValueError(line or f"limitray_bench ended with {process.returncode}")


def print_report(report: Report) -> None:
    """Prints where the figures come from, one table for each kind of ray, and the work a ray."""
    console = Console(width=max(Console().width, TABLE_WIDTH))
    machine = report["machine"]
    print(f"{report['model']}: {report['faces']:,} faces, {report['patches']:,} patches")
    print(
        f"{machine['cpu']}, {machine['isa']}, {report['threads']} threads, {machine['compiler']}, "
        f"Embree {machine['embree']}, commit {machine['commit']}"
    )
    for kind in ("primary", "diffuse"):
        rays, hits = report[f"{kind}_rays"], report[f"{kind}_hit_rate"]
        title = f"{kind} rays: {rays:,}, {hits:.0%} hit"
        table = Table(title=title, title_justify="left", box=box.SIMPLE)
        for name in COLUMNS:
            table.add_column(name, justify="left" if name == "tracer" else "right", no_wrap=True)
        rows = [row for row in report["rows"] if row["rays"] == kind]
        for row in rows:
            table.add_row(*_cells(row))
        console.print(table)
        work = ", ".join(f"{n:.2f} {k.replace('_', ' ')}" for k, n in rows[0]["per_ray"].items())
        print(f"limitray, a {kind} ray: {work}")


def _cells(row: dict[str, Any]) -> list[str]:
    if "skipped" in row:
        return [row["tracer"], f"skipped: {row['skipped']}"]
    return [
        row["tracer"],
        f"{row['mrays_per_s']:.2f}",
        f"{row['mrays_per_processor_s']:.2f}",
        f"{row['limitray_speedup']:.2f}x",
        f"{row['build_s']:.3f} s",
        f"{row['bytes'] / 2**20:,.1f} MiB",
        f"{row['mean_error']:.1e}",
        f"{row['max_error']:.1e}",
        f"{row['mismatches']:,}",
    ]


def _import_matplotlib() -> Any:
    try:
        import matplotlib
    except ImportError:
        raise ValueError("--plot needs matplotlib: pip install 'limitray[bench]'") from None
    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def plot(report: Report, path: Path) -> None:
    """Plots speed over mean error, for both kinds of ray, and memory over mean error."""
    pyplot = _import_matplotlib()
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 4), sharex=True, layout="constrained")
    for axis, kind in zip(axes, ("primary", "diffuse", "primary")):
        memory = axis is axes[2]
        for family, label in (
            ("limitray", "limitray"),
            ("embree-subdivision", "Embree subdivision, by rate"),
            ("embree-triangles", "Embree triangles, by quads a patch"),
        ):
            rows = [row for row in report["rows"] if _is_point(row, family, kind)]
            value = [
                row["bytes"] / 2**20 if memory else row["mrays_per_processor_s"] for row in rows
            ]
            error = [row["mean_error"] for row in rows]
            axis.plot(error, value, "D" if family == "limitray" else "o-", label=label)
            for x, y, row in zip(error, value, rows):
                rate = row["tracer"].rpartition("-")[2] if family != "limitray" else ""
                axis.annotate(rate, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=8)
        axis.set_xscale("log")
        axis.set_xlabel("mean error / extent")
        axis.set_yscale("log" if memory else "linear")
        axis.set_ylim(bottom=None if memory else 0)
        axis.set_ylabel("MiB" if memory else f"Mray a CPU second, {kind} rays")
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8)
    figure.suptitle(f"{Path(report['model']).stem}, {report['threads']} threads")
    figure.savefig(path, dpi=150)
    pyplot.close(figure)


def _is_point(row: dict[str, Any], family: str, kind: str) -> bool:
    name = row["tracer"] if family == "limitray" else row["tracer"].rpartition("-")[0]
    return bool(name == family and row["rays"] == kind and row.get("mean_error", 0) > 0)
