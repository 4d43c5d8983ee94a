"""Image textures: files in linear light, wrap modes, UDIM tiles, and filtering by mip levels.

A texture is looked up at texture coordinates (s, t) with (0, 0) at the lower left of the image, as
in USD. The footprint of a pixel, two differences of (s, t), chooses the mip level: the longer
difference counts, but not beyond four times the shorter one (several samples a pixel cover what
that leaves out). Between texels and between levels the lookup is linear.
"""

from __future__ import annotations

import io
import os
import re
import tempfile
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limitray import _core
from limitray._arrays import finite_vector, one_of, real_array, to_array
from limitray.image import srgb_to_linear

Wrap = Literal["repeat", "mirror", "clamp", "black"]
ColorSpace = Literal["auto", "sRGB", "raw"]
Array = NDArray[np.float64]

WRAPS = ("repeat", "mirror", "clamp", "black")
COLOR_SPACES = ("auto", "sRGB", "raw")
SUFFIXES = (".png", ".jpg", ".jpeg", ".exr")

_UDIM = "<UDIM>"


@dataclass(frozen=True)
class Adjustment:
    """How a texture is laid and coloured; see `Texture.adjusted`."""

    transform: Array = field(default_factory=lambda: np.eye(2, 3))
    scale: Array = field(default_factory=lambda: np.ones(3))
    bias: Array = field(default_factory=lambda: np.zeros(3))
    channel: int | None = None

    @classmethod
    def checked(
        cls, transform: ArrayLike, scale: ArrayLike, bias: ArrayLike, channel: int | None
    ) -> Adjustment:
        """The same from arguments; raises ValueError."""
        if channel is not None and channel not in (0, 1, 2):
            raise ValueError(f"channel must be 0, 1, 2 or None, not {channel!r}")
        matrix = real_array("transform", transform, (2, 3))
        if not np.isfinite(matrix).all():
            raise ValueError(f"transform must be finite, not {matrix.tolist()}")
        return cls(matrix, _three("scale", scale), _three("bias", bias), channel)

    def recolored(self, colors: Array) -> Array:
        """Colours (n, 3) with channel, scale and bias applied."""
        if self.channel is not None:
            colors = np.repeat(colors[:, self.channel, np.newaxis], 3, axis=1)
        if (self.scale == 1).all() and not self.bias.any():
            return colors
        return np.asarray(colors * self.scale + self.bias)


class Texture:
    """A colour image, or a set of UDIM tiles.

    Parameters
    ----------
    image : array (h, w, 3) of float
        Linear colours; row 0 is the top.
    wrap_s, wrap_t : {"repeat", "mirror", "clamp", "black"}
        What lies beyond [0, 1] in s and in t.

    Raises
    ------
    ValueError
        An argument has a wrong shape or value.
    """

    def __init__(self, image: ArrayLike, wrap_s: Wrap = "repeat", wrap_t: Wrap = "repeat") -> None:
        values = real_array("image", image, (None, None, 3), np.float32)
        if values.size == 0:
            raise ValueError(f"image must not be empty, got shape {values.shape}")
        self._tiles = {(0, 0): _mip_map(values)}
        self._udim = False
        self._set_wraps(wrap_s, wrap_t)
        self._adjustment = Adjustment()

    def _set_wraps(self, wrap_s: str, wrap_t: str) -> None:
        self._wraps = (one_of("wrap_s", wrap_s, WRAPS), one_of("wrap_t", wrap_t, WRAPS))

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        wrap_s: Wrap = "repeat",
        wrap_t: Wrap = "repeat",
        color_space: ColorSpace = "auto",
    ) -> Texture:
        """Reads a PNG, JPEG or EXR file.

        Parameters
        ----------
        path : path
            The file. With "<UDIM>" in its name, all files with a tile number from 1001 to 1999 in
            that place: tile 1001 + i + 10 j covers i <= s < i + 1, j <= t < j + 1.
        wrap_s, wrap_t : {"repeat", "mirror", "clamp", "black"}
            What lies beyond [0, 1]. Has no meaning for UDIM tiles; there it is black.
        color_space : {"auto", "sRGB", "raw"}
            How colours are stored; "auto" takes 8-bit images as sRGB and others as linear.

        Raises
        ------
        OSError
            A file cannot be opened.
        ValueError
            A file is no image, or there is no tile.
        """
        path = Path(path)
        if _UDIM not in path.name:
            return cls(read_image(path, color_space), wrap_s, wrap_t)
        tiles = {_tile_number(path, file): file for file in sorted(path.parent.glob("*"))}
        return cls.from_tiles({number: file for number, file in tiles.items() if number}, path)

    @classmethod
    def from_tiles(
        cls,
        files: dict[int, Path],
        name: str | os.PathLike[str],
        color_space: ColorSpace = "auto",
    ) -> Texture:
        """UDIM tiles by their number; `name` stands for all of them in errors."""
        if not files:
            raise FileNotFoundError(2, "no UDIM tile found", str(name))
        texture = cls.__new__(cls)
        texture._tiles = {
            ((number - 1001) % 10, (number - 1001) // 10): _mip_map(read_image(file, color_space))
            for number, file in files.items()
        }
        texture._udim = True
        texture._set_wraps("clamp", "clamp")
        texture._adjustment = Adjustment()
        return texture

    @classmethod
    def from_bytes(
        cls,
        data: bytes,
        name: str,
        wrap_s: Wrap = "repeat",
        wrap_t: Wrap = "repeat",
        color_space: ColorSpace = "auto",
    ) -> Texture:
        """The same from the content of a file; `name` gives its format and stands in errors."""
        return cls(_decode(data, name, color_space), wrap_s, wrap_t)

    def adjusted(
        self,
        transform: ArrayLike = ((1, 0, 0), (0, 1, 0)),
        scale: ArrayLike = 1.0,
        bias: ArrayLike = 0.0,
        channel: int | None = None,
    ) -> Texture:
        """The same image, laid and coloured in another way; it shares the memory of this one.

        Parameters
        ----------
        transform : array (2, 3)
            An affine map that is applied to texture coordinates first, on column vectors
            (s, t, 1). It takes the place of the one that this texture has, as do the others.
        scale, bias : float or array (3,)
            What the linear colours are multiplied by, and what is added then.
        channel : {0, 1, 2}, optional
            Red, green or blue, to be taken for all three, before scale and bias.

        Raises
        ------
        ValueError
            An argument has a wrong shape or value, or is not finite.
        """
        texture = copy(self)
        texture._adjustment = Adjustment.checked(transform, scale, bias, channel)
        return texture

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels, of the first tile."""
        first = next(iter(self._tiles.values()))
        return first.height, first.width

    @property
    def tiles(self) -> tuple[int, ...]:
        """Numbers of the UDIM tiles; none for a single image."""
        return tuple(sorted(1001 + i + 10 * j for i, j in self._tiles)) if self._udim else ()

    def sample(self, st: ArrayLike, d_dx: ArrayLike = 0.0, d_dy: ArrayLike = 0.0) -> Array:
        """Linear colours (n, 3) at texture coordinates `st` (n, 2).

        `d_dx` and `d_dy` are the differences of (s, t) to the neighbouring pixels, (n, 2) or (2,);
        without them the finest level is taken.
        """
        turned = self._adjustment.transform
        places = real_array("st", st, (None, 2)) @ turned[:, :2].T + turned[:, 2]
        x, y = (
            _differences(name, d) @ turned[:, :2].T for name, d in (("d_dx", d_dx), ("d_dy", d_dy))
        )
        return self._adjustment.recolored(self._stored(places, x, y))

    def _stored(self, places: Array, x: Array, y: Array) -> Array:
        """Colours as they are stored, at coordinates with their differences."""
        if not self._udim:
            return self._tiles[0, 0].sample(places, x, y, *self._wraps)
        colours = np.zeros((len(places), 3))
        cells = np.floor(places)
        for tile, image in self._tiles.items():
            rows = np.flatnonzero((cells == tile).all(axis=1))
            here_x, here_y = (d[rows] if len(d) > 1 else d for d in (x, y))
            colours[rows] = image.sample(places[rows] - tile, here_x, here_y, *self._wraps)
        return colours


def _three(name: str, values: ArrayLike) -> Array:
    """A finite number for each colour; one number stands for all."""
    array = to_array(name, values)
    return finite_vector(name, np.repeat(array, 3) if array.ndim == 0 else array)


def _mip_map(image: NDArray[np.float32]) -> _core.MipMap:
    """The levels of an image whose row 0 is the top."""
    return _core.MipMap(np.ascontiguousarray(image[::-1], np.float32))


def _differences(name: str, values: ArrayLike) -> Array:
    """Differences (n, 2), or (1, 2) where one pair or number is given for all."""
    array = np.atleast_1d(np.asarray(values, np.float64))
    if array.ndim == 1:
        array = np.broadcast_to(array, (1, 2))
    checked: Array = real_array(name, array, (None, 2))
    return checked


def _tile_number(pattern: Path, file: Path) -> int:
    """The tile number in the place of <UDIM>, 0 if the name does not fit."""
    before, _, after = pattern.name.partition(_UDIM)
    match = re.fullmatch(f"{re.escape(before)}(1[0-9]{{3}}){re.escape(after)}", file.name)
    return int(match[1]) if match and int(match[1]) > 1000 else 0


def read_image(path: Path, color_space: ColorSpace = "auto") -> NDArray[np.float32]:
    """Linear colours (h, w, 3) of a PNG, JPEG or EXR file; row 0 is the top."""
    return _decode(path.read_bytes(), str(path), color_space)


def _decode(data: bytes, name: str, color_space: str) -> NDArray[np.float32]:
    """Linear colours (h, w, 3), row 0 at the top, of a file's content."""
    one_of("color_space", color_space, COLOR_SPACES)
    suffix = Path(name).suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f'{name}: unknown texture format "{suffix}"; {", ".join(SUFFIXES)} work')
    try:
        pixels = _decode_exr(data) if suffix == ".exr" else _decode_pillow(data)
    except (OSError, ValueError, RuntimeError, TypeError) as error:
        raise ValueError(f"{name}: cannot be read as an image: {error}") from None
    is_srgb = color_space == "sRGB" or (color_space == "auto" and pixels.dtype == np.uint8)
    scale = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}.get(pixels.dtype, 1.0)
    if is_srgb and pixels.dtype == np.uint8:
        table = srgb_to_linear(np.arange(256) / 255.0).astype(np.float32)
        return np.asarray(table[pixels])
    values = pixels.astype(np.float32) / np.float32(scale)
    return srgb_to_linear(values).astype(np.float32) if is_srgb else values


def _decode_pillow(data: bytes) -> NDArray[Any]:
    """Pixels (h, w, 3): uint8, or uint16 for 16-bit grey images."""
    from PIL import Image as PillowImage

    with PillowImage.open(io.BytesIO(data)) as image:
        if image.mode.startswith("I;16") or image.mode == "I":
            grey = np.asarray(image).astype(np.uint16)
            return np.repeat(grey[..., np.newaxis], 3, axis=2)
        return np.asarray(image.convert("RGB"))


def _decode_exr(data: bytes) -> NDArray[Any]:
    """Pixels (h, w, 3) of the channels R, G, B, or three times Y."""
    import OpenEXR

    with tempfile.NamedTemporaryFile(suffix=".exr") as file:
        file.write(data)
        file.flush()
        with OpenEXR.File(file.name, separate_channels=True) as exr:
            channels = {name: channel.pixels for name, channel in exr.channels().items()}
    names = "RGB" if "R" in channels else "YYY"
    missing = [name for name in names if name not in channels]
    if missing:
        raise ValueError(f"no channel {missing[0]}; there are {', '.join(sorted(channels))}")
    return np.stack([channels[name] for name in names], axis=2).astype(np.float32)
