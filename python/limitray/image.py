"""Pictures in linear light, and how they are saved."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMATS = (".png", ".exr")


@dataclass(frozen=True, eq=False)
class Image:
    """A rendered picture; shows itself in notebooks.

    Parameters
    ----------
    rgba : array (height, width, 4) of float32
        Linear colour (sRGB primaries), premultiplied by alpha; alpha is 0 where nothing was hit.
    background : array (height, width, 3) of float32
        Linear colour that shows where alpha is below 1, in PNG files and notebooks.
    aovs : dict of arrays
        Layers by name: "depth" (h, w), inf for a miss; "normal" and "position" (h, w, 3), 0 for a
        miss; "face" and "patch" (h, w) uint32, 0xFFFFFFFF for a miss.
    """

    rgba: NDArray[np.float32]
    background: NDArray[np.float32]
    aovs: dict[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def width(self) -> int:
        """Width in pixels."""
        return int(self.rgba.shape[1])

    @property
    def height(self) -> int:
        """Height in pixels."""
        return int(self.rgba.shape[0])

    def linear(self) -> NDArray[np.float32]:
        """Linear colour (height, width, 3) of the picture on its background."""
        composed = self.rgba[..., :3] + (1 - self.rgba[..., 3:]) * self.background
        return composed.astype(np.float32)

    def srgb(self) -> NDArray[np.uint8]:
        """The picture on its background as sRGB bytes (height, width, 3)."""
        return np.round(255 * linear_to_srgb(self.linear())).astype(np.uint8)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a .png file (sRGB, on the background) or an .exr file (linear, all layers).

        The EXR file has the channels R, G, B (premultiplied) and A, then depth.Z, normal.X/Y/Z,
        position.X/Y/Z, face.id and patch.id for the layers the picture has.

        Raises
        ------
        ValueError
            The name ends in something else.
        OSError
            The file cannot be written.
        """
        path = Path(path)
        check_format(path)
        if path.suffix.lower() == ".png":
            path.write_bytes(self._repr_png_())
        else:
            self._save_exr(path)

    def _repr_png_(self) -> bytes:
        from PIL import Image as PillowImage

        buffer = io.BytesIO()
        PillowImage.fromarray(self.srgb()).save(buffer, "png", optimize=True)
        return buffer.getvalue()

    def _save_exr(self, path: Path) -> None:
        import OpenEXR  # type: ignore[import-not-found, import-untyped, unused-ignore]

        channels = {name: self.rgba[..., k] for k, name in enumerate("RGBA")}
        for name, layer in self.aovs.items():
            if layer.ndim == 3:
                channels |= {f"{name}.{axis}": layer[..., k] for k, axis in enumerate("XYZ")}
            else:
                channels[f"{name}.Z" if name == "depth" else f"{name}.id"] = layer
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        packed = {name: np.ascontiguousarray(values) for name, values in channels.items()}
        with path.open("wb"):
            pass
        OpenEXR.File(header, packed).write(str(path))


def check_format(path: Path) -> None:
    """Raises ValueError unless the name ends in a format that `Image.save` writes."""
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f'{path}: a picture must end in .png or .exr, not "{path.suffix}"')


def linear_to_srgb(values: NDArray[Any]) -> NDArray[np.float64]:
    """sRGB-encoded values in [0, 1]; linear values beyond 1 are cut to white."""
    x = np.clip(values, 0, 1)
    return np.asarray(np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055))


def srgb_to_linear(values: NDArray[Any]) -> NDArray[np.float64]:
    """Linear values of sRGB-encoded values in [0, 1]."""
    x = np.clip(values, 0, 1)
    return np.asarray(np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4))
