"""What the commands share: arguments, options, and how their texts are read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from limitray.camera import Vector
from limitray.scene import DEVICES

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
        "surface at extraordinary vertices, and takes more patches. Chosen by --tolerance "
        "unless given.",
    ),
]
ToleranceOption = Annotated[
    float | None,
    typer.Option(
        help="How far the surface may be from the true limit, relative to the longest side of the "
        "box around the cage; chooses the isolation level. [default: 1e-5]"
    ),
]
ThreadsOption = Annotated[int, typer.Option(min=0, max=4096, help="Threads; 0 takes all cores.")]
DeviceOption = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="Where rays are traced: cpu; or gpu, vulkan, cuda, metal (needs limitray[gpu]).",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print facts as JSON to stdout.")]


def check_level(isolation_level: int | None, tolerance: float | None) -> None:
    """Raises BadParameter if both are given: one chooses the other."""
    if isolation_level is not None and tolerance is not None:
        raise typer.BadParameter("exclude each other", param_hint="--isolation-level, --tolerance")


def parse_vector(text: str) -> Vector:
    """Three numbers in a row such as "1,2.5,-3"."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f'"{text}" is not three numbers such as 1,2.5,-3') from None
    return x, y, z


def parse_size(text: str) -> tuple[int, int]:
    """Two positive integers such as "960x720"."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise typer.BadParameter(f'"{text}" is not a size such as 960x720')
    return int(width), int(height)


def parse_names(option: str, text: str, choices: tuple[str, ...]) -> tuple[str, ...]:
    """Names from `choices`, separated by commas."""
    names = tuple(dict.fromkeys(name for name in text.split(",") if name))
    for name in names:
        if name not in choices:
            raise typer.BadParameter(
                f'"{name}" is not one of {", ".join(choices)}', param_hint=option
            )
    return names


def check_device(device: str) -> str:
    """`device`, if there is such a name; raises BadParameter otherwise."""
    if device not in DEVICES:
        raise typer.BadParameter(
            f'"{device}" is not one of {", ".join(DEVICES)}', param_hint="--device"
        )
    return device


def check_suffix(output: Path, suffixes: tuple[str, ...]) -> None:
    """Raises BadParameter unless the name ends in one of `suffixes`."""
    if output.suffix.lower() not in suffixes:
        raise typer.BadParameter(
            f'"{output}" does not end in {" or ".join(suffixes)}', param_hint="--output"
        )


def vector_option(text: str) -> Any:
    """An option of three numbers, with its help."""
    return typer.Option(metavar="X,Y,Z", parser=parse_vector, help=text)
