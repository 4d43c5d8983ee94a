"""The command line: `limitray render`, `limitray info`, `limitray cast`, `convert`, `bench`.

Results go to stdout, progress and errors to stderr. Exit codes: 0 done, 1 failed, 2 wrong usage,
130 stopped by Ctrl-C.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from limitray import cli_options as options
from limitray import cli_output
from limitray._queries import ATTRIBUTES, PRIMVAR_PREFIX
from limitray.bench import bench_command
from limitray.cli_render import render_command
from limitray.convert import convert_command
from limitray.info import mesh_info
from limitray.mesh import Mesh
from limitray.models import load_model

app = typer.Typer(
    help="Exact ray tracing of Catmull-Clark subdivision surfaces.",
    epilog="Exit codes: 0 done, 1 failed, 2 wrong usage, 130 stopped by Ctrl-C.",
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.command("render")(render_command)
app.command("convert")(convert_command)
app.command("bench")(bench_command)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        print(cli_output.version())
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit(2)


@app.command("info")
def info_command(
    model: options.ModelArgument,
    prim: options.PrimOption = None,
    isolation_level: options.LevelOption = None,
    tolerance: options.ToleranceOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Prints what MODEL is made of: faces, vertices, creases, patches, memory, warnings.

    Examples:

        limitray info spot.obj

        limitray info spot.obj --isolation-level 6 --json
    """
    options.check_level(isolation_level, tolerance)
    facts = mesh_info(Mesh.from_file(model, prim), isolation_level, tolerance)
    if as_json:
        print(json.dumps({"model": str(model), **facts}, indent=2))
    else:
        cli_output.print_info(model, facts)


@app.command("cast")
def cast_command(
    model: options.ModelArgument,
    rays: Annotated[
        Path,
        typer.Argument(
            metavar="RAYS.npy", help="Array (..., 6) of float32 or float64: origin, direction."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Hits to write: .npz.")],
    attributes: Annotated[
        str,
        typer.Option(
            metavar="A,B,..",
            help=f"Also write: {', '.join(ATTRIBUTES)}, and primvars such as primvars:st.",
        ),
    ] = "",
    tnear: Annotated[float, typer.Option(help="Hits lie beyond this t.")] = 0.0,
    tfar: Annotated[float, typer.Option(help="Hits lie up to this t.")] = float("inf"),
    prim: options.PrimOption = None,
    isolation_level: options.LevelOption = None,
    tolerance: options.ToleranceOption = None,
    threads: options.ThreadsOption = 0,
    device: options.DeviceOption = "cpu",
    as_json: options.JsonOption = False,
) -> None:
    """Shoots the rays of RAYS.npy at MODEL and writes the closest hits.

    HITS.npz holds t_hit (inf for a miss), geometry_ids, primitive_ids (the base face),
    primitive_uvs and primitive_normals, each with the shape of the rays. float64 rays are answered
    in double arithmetic, on the CPU only.

    Examples:

        limitray cast spot.obj rays.npy -o hits.npz

        limitray cast spot.obj rays.npy -o hits.npz --attributes points,dp_du,dp_dv
    """
    names = _parse_attributes(attributes)
    options.check_level(isolation_level, tolerance)
    options.check_suffix(output, (".npz",))
    options.check_device(device)
    cli_output.check_writable(output)
    array = _load_rays(rays)
    scene = load_model(
        model,
        prim,
        isolation_level=isolation_level,
        tolerance=tolerance,
        threads=threads,
        device=device,
    )

    start = time.perf_counter()
    count = array.size // 6
    with cli_output.progress("casting") as report:
        hits: dict[str, Any] = scene.cast_rays(
            array, tnear, tfar, names, progress=lambda done: report(done, count)
        )
    seconds = time.perf_counter() - start
    with output.open("wb") as file:
        np.savez(file, **hits)
    cli_output.print_cast(output, count, int(np.isfinite(hits["t_hit"]).sum()), seconds, as_json)


def _parse_attributes(text: str) -> tuple[str, ...]:
    """Names of attributes; those of primvars are checked against the scene later."""
    names = tuple(dict.fromkeys(name for name in text.split(",") if name))
    plain = ",".join(name for name in names if not name.startswith(PRIMVAR_PREFIX))
    options.parse_names("--attributes", plain, ATTRIBUTES)
    return names


def _load_rays(path: Path) -> NDArray[Any]:
    with path.open("rb") as file:
        try:
            return np.lib.format.read_array(file, allow_pickle=False)
        except ValueError:
            raise ValueError(f"{path}: not a .npy file of numbers") from None


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns its exit code. `arguments` default to those of the process."""
    command = typer.main.get_command(app)
    try:
        code = command.main(arguments, prog_name="limitray", standalone_mode=False)
        return code if isinstance(code, int) else 0
    except typer.TyperException as error:
        return cli_output.fail(error.format_message(), error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        return cli_output.fail("stopped", 130)
    except (OSError, ValueError, MemoryError, RuntimeError, ImportError) as error:
        return cli_output.fail(_describe(error), 1)


def _describe(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return str(error) or type(error).__name__


if __name__ == "__main__":
    sys.exit(main())
