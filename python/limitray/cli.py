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

from limitray import cli_output
from limitray.bench import bench_command
from limitray.camera import Camera, Vector
from limitray.convert import convert_command
from limitray.image import FORMATS
from limitray.info import mesh_info
from limitray.mesh import Mesh
from limitray.models import load_model, set_texture, stage_camera
from limitray.render import AOVS, RenderInterrupted, render
from limitray.scene import ATTRIBUTES, PRIMVAR_PREFIX
from limitray.shading import INTEGRATORS
from limitray.texture import Texture

app = typer.Typer(
    help="Exact ray tracing of Catmull-Clark subdivision surfaces.",
    epilog="Exit codes: 0 done, 1 failed, 2 wrong usage, 130 stopped by Ctrl-C.",
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

ModelArgument = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL", help="Cage: a Wavefront OBJ file (with `t` tags), or a USD file."
    ),
]
PrimOption = Annotated[
    str | None, typer.Option(help="Path of the one mesh to take from a USD file.")
]
LevelOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=10,
        help="How deep irregular features are isolated: deeper is closer to the true limit "
        "surface at extraordinary vertices, and takes more patches. Default 4.",
    ),
]
ThreadsOption = Annotated[int, typer.Option(min=0, help="Threads; 0 takes all cores.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print facts as JSON to stdout.")]


def _parse_vector(text: str) -> Vector:
    """Three numbers in a row such as "1,2.5,-3"."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f'"{text}" is not three numbers such as 1,2.5,-3') from None
    return x, y, z


def _parse_size(text: str) -> tuple[int, int]:
    """Two positive integers such as "960x720"."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise typer.BadParameter(f'"{text}" is not a size such as 960x720')
    return int(width), int(height)


def _parse_names(option: str, text: str, choices: tuple[str, ...]) -> tuple[str, ...]:
    """Names from `choices`, separated by commas."""
    names = tuple(dict.fromkeys(name for name in text.split(",") if name))
    for name in names:
        if name not in choices:
            raise typer.BadParameter(
                f'"{name}" is not one of {", ".join(choices)}', param_hint=option
            )
    return names


def _parse_attributes(text: str) -> tuple[str, ...]:
    """Names of attributes; those of primvars are checked against the scene later."""
    names = tuple(dict.fromkeys(name for name in text.split(",") if name))
    plain = ",".join(name for name in names if not name.startswith(PRIMVAR_PREFIX))
    _parse_names("--attributes", plain, ATTRIBUTES)
    return names


def _check_suffix(output: Path, suffixes: tuple[str, ...]) -> None:
    if output.suffix.lower() not in suffixes:
        raise typer.BadParameter(
            f'"{output}" does not end in {" or ".join(suffixes)}', param_hint="--output"
        )


def _load_rays(path: Path) -> NDArray[Any]:
    with path.open("rb") as file:
        try:
            return np.lib.format.read_array(file, allow_pickle=False)
        except ValueError:
            raise ValueError(f"{path}: not a .npy file of numbers") from None


def _vector_option(text: str) -> Any:
    return typer.Option(metavar="X,Y,Z", parser=_parse_vector, help=text)


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


@app.command("render")
def render_command(
    model: ModelArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Picture to write: .png, or .exr with layers.")
    ],
    eye: Annotated[Any, _vector_option("Position of the camera; framed automatically.")] = None,
    center: Annotated[Any, _vector_option("Point to look at; needs --eye.")] = None,
    up: Annotated[
        Any, _vector_option("Direction that points up; 0,1,0 unless a USD stage says otherwise.")
    ] = None,
    fov: Annotated[float, typer.Option(help="Horizontal field of view, degrees.")] = 28.0,
    camera_path: Annotated[
        str | None, typer.Option("--camera", metavar="PATH", help="Camera of a USD stage.")
    ] = None,
    prim: PrimOption = None,
    time_code: Annotated[
        float | None,
        typer.Option("--time", help="Time code of a USD stage; its start unless given."),
    ] = None,
    texture: Annotated[
        Path | None,
        typer.Option(
            help="Colours: a .png, .jpg or .exr image on the texture coordinates; <UDIM> in its "
            "name stands for tile numbers."
        ),
    ] = None,
    size: Annotated[
        Any, typer.Option(metavar="WxH", parser=_parse_size, help="Picture size in pixels.")
    ] = "960x720",
    spp: Annotated[int, typer.Option(min=1, help="Samples a pixel.")] = 16,
    integrator: Annotated[
        str, typer.Option(metavar="NAME", help=f"What to show: {', '.join(INTEGRATORS)}.")
    ] = "ao",
    aov: Annotated[
        str, typer.Option(metavar="A,B,..", help=f"Layers of an .exr: {', '.join(AOVS)}.")
    ] = "",
    isolation_level: LevelOption = None,
    threads: ThreadsOption = 0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random numbers.")] = 0,
    stats: Annotated[bool, typer.Option("--stats", help="Print rates and counters.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Renders a picture of MODEL.

    Ctrl-C saves the picture so far and exits with code 130.

    Examples:

        limitray render spot.obj -o spot.png

        limitray render spot.obj -o uv.png --integrator uv --size 1920x1080 --spp 32

        limitray render spot.obj -o close.png --eye 1,2,4 --center 0,0.5,0 --fov 20

        limitray render spot.obj -o layers.exr --aov depth,normal,face

        limitray render spot.obj -o spot.png --texture spot_texture.png

        limitray render shot.usd -o shot.png --camera /World/Camera --time 24
    """
    layers = _parse_names("--aov", aov, AOVS)
    _parse_names("--integrator", integrator, INTEGRATORS)
    _check_suffix(output, FORMATS)
    if layers and output.suffix.lower() != ".exr":
        raise typer.BadParameter("needs an output that ends in .exr", param_hint="--aov")
    if (eye is None) != (center is None):
        raise typer.BadParameter("go together", param_hint="--eye and --center")
    if eye is not None and camera_path is not None:
        raise typer.BadParameter("exclude each other", param_hint="--eye and --camera")
    cli_output.check_writable(output)

    scene = load_model(model, prim, time_code, isolation_level, threads)
    if texture is not None:
        set_texture(scene, Texture.from_file(texture))
    width, height = size
    up = up or (scene.stage.up if scene.stage else (0.0, 1.0, 0.0))
    camera = Camera(eye, center, up, fov) if eye is not None else stage_camera(scene, camera_path)
    camera = camera or Camera.frame(scene, width / height, up=up, fov_deg=fov)
    scene.reset_statistics()
    start = time.perf_counter()
    interrupted = False
    try:
        with cli_output.progress("rendering") as report:
            image = render(
                scene, camera, width, height, spp, integrator, layers, seed, progress=report
            )
    except RenderInterrupted as stop:
        interrupted, image = True, stop.image
    seconds = time.perf_counter() - start
    image.save(output)
    cli_output.print_render(output, scene, seconds, interrupted, stats, as_json)
    if interrupted:
        raise typer.Exit(130)


@app.command("info")
def info_command(
    model: ModelArgument,
    prim: PrimOption = None,
    isolation_level: LevelOption = None,
    as_json: JsonOption = False,
) -> None:
    """Prints what MODEL is made of: faces, vertices, creases, patches, memory, warnings.

    Examples:

        limitray info spot.obj

        limitray info spot.obj --isolation-level 6 --json
    """
    facts = mesh_info(Mesh.from_file(model, prim), isolation_level)
    if as_json:
        print(json.dumps({"model": str(model), **facts}, indent=2))
    else:
        cli_output.print_info(model, facts)


@app.command("cast")
def cast_command(
    model: ModelArgument,
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
    prim: PrimOption = None,
    isolation_level: LevelOption = None,
    threads: ThreadsOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Shoots the rays of RAYS.npy at MODEL and writes the closest hits.

    HITS.npz holds t_hit (inf for a miss), geometry_ids, primitive_ids (the base face),
    primitive_uvs and primitive_normals, each with the shape of the rays. float64 rays are answered
    in double arithmetic.

    Examples:

        limitray cast spot.obj rays.npy -o hits.npz

        limitray cast spot.obj rays.npy -o hits.npz --attributes points,dp_du,dp_dv
    """
    names = _parse_attributes(attributes)
    _check_suffix(output, (".npz",))
    cli_output.check_writable(output)
    array = _load_rays(rays)
    scene = load_model(model, prim, None, isolation_level, threads)

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
    except (OSError, ValueError, MemoryError, RuntimeError) as error:
        return cli_output.fail(_describe(error), 1)


def _describe(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return str(error) or type(error).__name__


if __name__ == "__main__":
    sys.exit(main())
