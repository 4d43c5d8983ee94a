"""The command `limitray render`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from limitray import cli_output
from limitray.camera import Camera, Vector
from limitray.cli_options import (
    DeviceOption,
    JsonOption,
    LevelOption,
    ModelArgument,
    PrimOption,
    ThreadsOption,
    ToleranceOption,
    check_device,
    check_level,
    check_suffix,
    parse_names,
    parse_size,
    parse_vector,
    vector_option,
)
from limitray.image import FORMATS
from limitray.light import Sun
from limitray.models import load_model, set_finish, set_texture, stage_camera
from limitray.render import AOVS, RenderInterrupted, render
from limitray.shading import INTEGRATORS
from limitray.sky import ConstantSky, ImageSky
from limitray.texture import SUFFIXES, Texture

MAX_DEPTH = 6


def render_command(
    model: ModelArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Picture to write: .png, or .exr with layers.")
    ],
    eye: Annotated[Any, vector_option("Position of the camera; framed automatically.")] = None,
    center: Annotated[Any, vector_option("Point to look at; needs --eye.")] = None,
    up: Annotated[
        Any, vector_option("Direction that points up; 0,1,0 unless a USD stage says otherwise.")
    ] = None,
    fov: Annotated[float, typer.Option(help="Horizontal field of view, degrees.")] = 28.0,
    camera_path: Annotated[
        str | None,
        typer.Option("--camera", metavar="PATH", help="Camera of a USD stage, its gate fitted."),
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
        Any, typer.Option(metavar="WxH", parser=parse_size, help="Picture size in pixels.")
    ] = "960x720",
    spp: Annotated[int, typer.Option(min=1, help="Samples a pixel.")] = 16,
    integrator: Annotated[
        str, typer.Option(metavar="NAME", help=f"What to show: {', '.join(INTEGRATORS)}.")
    ] = "ao",
    aov: Annotated[
        str, typer.Option(metavar="A,B,..", help=f"Layers of an .exr: {', '.join(AOVS)}.")
    ] = "",
    sky: Annotated[
        str | None,
        typer.Option(
            metavar="IMAGE|R,G,B",
            help="path: environment light, an .exr, .png or .jpg of the whole sphere, or a colour.",
        ),
    ] = None,
    sun: Annotated[Any, vector_option("path: direction towards a sun.")] = None,
    max_depth: Annotated[
        int, typer.Option(min=1, help="path: surfaces between a light and the camera.")
    ] = MAX_DEPTH,
    denoise: Annotated[
        bool, typer.Option("--denoise", help="path: remove noise (needs limitray[denoise]).")
    ] = False,
    roughness: Annotated[
        float | None, typer.Option(help="path: finish of all surfaces, 0.05 to 1; else diffuse.")
    ] = None,
    metallic: Annotated[float, typer.Option(help="path: 0 dielectric, 1 metal.")] = 0.0,
    isolation_level: LevelOption = None,
    tolerance: ToleranceOption = None,
    threads: ThreadsOption = 0,
    device: DeviceOption = "cpu",
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

        limitray render spot.obj -o lit.png --integrator path --sun 1,2,1

        limitray render shot.usd -o shot.png --camera /World/Camera --time 24
    """
    layers = parse_names("--aov", aov, AOVS)
    parse_names("--integrator", integrator, INTEGRATORS)
    check_suffix(output, FORMATS)
    check_level(isolation_level, tolerance)
    for_path = {
        "--sky": sky is not None,
        "--sun": sun is not None,
        "--max-depth": max_depth != MAX_DEPTH,
        "--denoise": denoise,
        "--roughness": roughness is not None,
        "--metallic": bool(metallic),
    }
    given = [name for name, is_given in for_path.items() if is_given]
    if integrator != "path" and given:
        raise typer.BadParameter("for --integrator path alone", param_hint=", ".join(given))
    lighting = _lighting(sky, sun, max_depth, denoise) if integrator == "path" else {}
    if layers and output.suffix.lower() != ".exr":
        raise typer.BadParameter("needs an output that ends in .exr", param_hint="--aov")
    if (eye is None) != (center is None):
        raise typer.BadParameter("go together", param_hint="--eye and --center")
    if eye is not None and camera_path is not None:
        raise typer.BadParameter("exclude each other", param_hint="--eye and --camera")
    check_device(device)
    cli_output.check_writable(output)

    scene = load_model(model, prim, time_code, isolation_level, tolerance, threads, device)
    if texture is not None:
        set_texture(scene, Texture.from_file(texture))
    if roughness is not None or metallic:
        set_finish(scene, roughness, metallic)
    width, height = size
    if eye is not None and up is None:
        up = scene.stage.up if scene.stage else (0.0, 1.0, 0.0)
    camera = Camera(eye, center, up, fov) if eye is not None else stage_camera(scene, camera_path)
    camera = camera or Camera.frame(scene, width / height, up=up, fov_deg=fov)
    scene.reset_statistics()
    start = time.perf_counter()
    interrupted = False
    try:
        with cli_output.progress("rendering") as report:
            image = render(
                scene,
                camera,
                width,
                height,
                spp,
                integrator,
                layers,
                seed,
                progress=report,
                **lighting,
            )
    except RenderInterrupted as stop:
        interrupted, image = True, stop.image
    seconds = time.perf_counter() - start
    image.save(output)
    cli_output.print_render(output, scene, seconds, interrupted, stats, as_json)
    if interrupted:
        raise typer.Exit(130)


def _lighting(sky: str | None, sun: Vector | None, max_depth: int, denoise: bool) -> dict[str, Any]:
    """The arguments of `render` that are for the integrator "path"."""
    given: dict[str, Any] = {"max_depth": max_depth, "denoise": denoise}
    if sky is not None:
        is_image = Path(sky).suffix.lower() in SUFFIXES
        given["sky"] = ImageSky.from_file(sky) if is_image else ConstantSky(parse_vector(sky))
    if sun is not None:
        given["lights"] = [Sun(sun)]
    return given
