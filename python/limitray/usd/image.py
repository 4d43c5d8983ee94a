"""Images that a USD stage names: beside it, inside a .usdz file, or as UDIM tiles."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from limitray.texture import Texture, Wrap

if TYPE_CHECKING:
    from pxr import Sdf, Usd


def load_texture(
    asset: Sdf.AssetPath, attribute: Usd.Attribute, options: dict[str, str]
) -> Texture:
    """The texture of an asset path, the value of `attribute`.

    `options` are wrapS, wrapT and sourceColorSpace of the UsdUVTexture. Raises OSError or
    ValueError if there is no such image.
    """
    from pxr import Ar, UsdShade

    space: Any = {"sRGB": "sRGB", "raw": "raw"}.get(options["sourceColorSpace"], "auto")
    if "<UDIM>" in asset.path:
        layer = attribute.GetPropertyStack()[0].layer
        found = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layer)
        return Texture.from_tiles({int(n): Path(path) for path, n in found}, asset.path, space)
    resolved = str(asset.resolvedPath)
    opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
    if not opened:
        raise FileNotFoundError(2, "no such file", asset.path)
    name = resolved.rpartition("[")[2].rstrip("]")
    with opened:
        data = bytes(opened.GetBuffer())
    if space == "auto" and _is_grey(data):
        space = "raw"
    return Texture.from_bytes(data, name, _wrap(options["wrapS"]), _wrap(options["wrapT"]), space)


def _is_grey(data: bytes) -> bool:
    """Whether an image has one channel of colour: USD takes such a one as linear."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            return (
                len([band for band in image.getbands() if band != "A"]) == 1 and image.mode != "P"
            )
    except OSError:  # not an 8-bit format
        return False


def _wrap(token: str) -> Wrap:
    """USD's wrap mode; without an opinion, in the file or the stage, it is black."""
    return cast(Wrap, token) if token in ("repeat", "mirror", "clamp") else "black"
