"""The command `limitray convert`: control cages from one file format to another."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from limitray.mesh import USD_SUFFIXES, Mesh
from limitray.obj import write_obj


def convert(
    source: str | os.PathLike[str], target: str | os.PathLike[str], prim: str | None = None
) -> tuple[str, ...]:
    """Writes the cage of one file to another, of the format that its name ends in.

    Parameters
    ----------
    source : path
        An .obj, .usd, .usda, .usdc or .usdz file.
    target : path
        An .obj, .usd, .usda or .usdc file; an existing one is replaced.
    prim : str, optional
        Path of the mesh in a USD file; may be left out if it has only one.

    Returns
    -------
    tuple of str
        What the target cannot hold.

    Raises
    ------
    OSError
        A file cannot be opened.
    ValueError
        The source cannot be read, or the target has an unknown format or cannot hold the cage.
    """
    target = Path(target)
    suffix = target.suffix.lower()
    if suffix != ".obj" and (suffix not in USD_SUFFIXES or suffix == ".usdz"):
        raise ValueError(f'{target}: must end in .obj, .usd, .usda or .usdc, not "{target.suffix}"')
    mesh = Mesh.from_file(source, prim)
    if suffix == ".obj":
        return write_obj(mesh, target)
    from limitray.usd import write_usd

    write_usd(mesh, target)
    return ()


def convert_command(
    source: Annotated[
        Path, typer.Argument(metavar="IN", help="Cage: .obj, .usd, .usda, .usdc or .usdz.")
    ],
    target: Annotated[
        Path, typer.Argument(metavar="OUT", help="File to write: .obj, .usd, .usda or .usdc.")
    ],
    prim: Annotated[str | None, typer.Option(help="Mesh to take from a USD file.")] = None,
) -> None:
    """Writes the cage of IN, with its subdivision tags and texture coordinates, as OUT.

    Reading OUT gives an equal cage. USD keeps points as float32; OBJ has no orientation, so that
    left-handed faces are turned round, and of primvars only the texture coordinates "st".

    Examples:

        limitray convert chess.usda pawn.obj --prim /ChessSet/Pawn/Geom

        limitray convert spot.obj spot.usdc
    """
    for note in convert(source, target, prim):
        typer.echo(f"limitray: {note}", err=True)
