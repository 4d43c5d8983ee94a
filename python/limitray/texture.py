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
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limitray._arrays import one_of, real_array
from limitray.image import srgb_to_linear

Wrap = Literal["repeat", "mirror", "clamp", "black"]
ColorSpace = Literal["auto", "sRGB", "raw"]
Array = NDArray[np.float64]

WRAPS = ("repeat", "mirror", "clamp", "black")
COLOR_SPACES = ("auto", "sRGB", "raw")
SUFFIXES = (".png", ".jpg", ".jpeg", ".exr")
MAX_ANISOTROPY = 4.0
"""How far the longer side of a footprint may exceed the shorter before detail is kept."""

_UDIM = "<UDIM>"


@dataclass(frozen=True, eq=False)
class _Pyramid:
    """One image, finest level first: arrays (h, w, 3) of linear float32; row 0 is the bottom."""

    levels: tuple[NDArray[np.float32], ...]

    @classmethod
    def of(cls, image: NDArray[np.float32]) -> _Pyramid:
        levels = [np.ascontiguousarray(image[::-1])]
        while max(levels[-1].shape[:2]) > 1:
            levels.append(_halved(levels[-1]))
        return cls(tuple(levels))


def _halved(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Half the size, rounded up, by averaging; an odd last row or column is repeated."""
    height, width = image.shape[:2]
    padded = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    half: NDArray[np.float32] = padded.reshape((height + 1) // 2, 2, (width + 1) // 2, 2, 3).mean(
        axis=(1, 3), dtype=np.float32
    )
    return half


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
        self._tiles = {(0, 0): _Pyramid.of(values)}
        self._udim = False
        self._set_wraps(wrap_s, wrap_t)

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
            ((number - 1001) % 10, (number - 1001) // 10): _Pyramid.of(read_image(file, color_space))
            for number, file in files.items()
        }
        texture._udim = True
        texture._set_wraps("clamp", "clamp")
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

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels, of the first tile."""
        level = next(iter(self._tiles.values())).levels[0]
        return int(level.shape[0]), int(level.shape[1])

    @property
    def tiles(self) -> tuple[int, ...]:
        """Numbers of the UDIM tiles; none for a single image."""
        return tuple(sorted(1001 + i + 10 * j for i, j in self._tiles)) if self._udim else ()

    def sample(self, st: ArrayLike, d_dx: ArrayLike = 0.0, d_dy: ArrayLike = 0.0) -> Array:
        """Linear colours (n, 3) at texture coordinates `st` (n, 2).

        `d_dx` and `d_dy` (n, 2) are the differences of (s, t) to the neighbouring pixels; without
        them the finest level is taken.
        """
        places = real_array("st", st, (None, 2))
        differences = [
            np.broadcast_to(np.asarray(d, np.float64), places.shape) for d in (d_dx, d_dy)
        ]
        colours = np.zeros((len(places), 3))
        if not self._udim:
            self._add(self._tiles[0, 0], colours, np.arange(len(places)), places, differences)
            return colours
        cells = np.floor(places)
        for tile, pyramid in self._tiles.items():
            rows = np.flatnonzero((cells == tile).all(axis=1))
            self._add(pyramid, colours, rows, places - tile, differences)
        return colours

    def _add(
        self,
        pyramid: _Pyramid,
        colours: Array,
        rows: NDArray[np.intp],
        places: Array,
        differences: list[Array],
    ) -> None:
        """Writes the colours of `rows`: linear between the two nearest levels."""
        size = pyramid.levels[0].shape[1::-1]
        level = _levels([d[rows] * size for d in differences], len(pyramid.levels) - 1)
        lower = np.floor(level).astype(int)
        blend = (level - lower)[:, np.newaxis]
        for k in np.unique(lower):
            here = lower == k
            st = places[rows[here]]
            fine = _bilinear(pyramid.levels[k], st, self._wraps)
            coarse = _bilinear(pyramid.levels[min(k + 1, len(pyramid.levels) - 1)], st, self._wraps)
            colours[rows[here]] = fine + blend[here] * (coarse - fine)


def _levels(differences: list[Array], coarsest: int) -> Array:
    """Mip level (n,) for footprints in texels of the finest level."""
    a, b = (np.linalg.norm(d, axis=1) for d in differences)
    longer, shorter = np.maximum(a, b), np.minimum(a, b)
    width = np.where(shorter > 0, np.minimum(longer, MAX_ANISOTROPY * shorter), longer)
    with np.errstate(divide="ignore"):
        level: Array = np.clip(np.nan_to_num(np.log2(width), nan=0.0), 0, coarsest)
    return level


def _bilinear(image: NDArray[np.float32], st: Array, wraps: tuple[str, str]) -> NDArray[np.float64]:
    """Colours (n, 3) at (s, t): linear between the centres of the four nearest texels."""
    height, width = image.shape[:2]
    x, y = st[:, 0] * width - 0.5, st[:, 1] * height - 0.5
    i, j = np.floor(x), np.floor(y)
    across, upward = (x - i)[:, np.newaxis], (y - j)[:, np.newaxis]
    columns = [_wrapped(i + k, width, wraps[0]) for k in (0, 1)]
    lines = [_wrapped(j + k, height, wraps[1]) for k in (0, 1)]
    texels = [[_texels(image, column, line) for column in columns] for line in lines]
    below, above = (left + across * (right - left) for left, right in texels)
    return np.asarray(below + upward * (above - below))


def _texels(
    image: NDArray[np.float32], columns: NDArray[np.int64], lines: NDArray[np.int64]
) -> Array:
    """Colours (n, 3), black where an index is negative."""
    inside = (columns >= 0) & (lines >= 0)
    return image[lines, columns].astype(np.float64) * inside[:, np.newaxis]


def _wrapped(index: Array, size: int, wrap: str) -> NDArray[np.int64]:
    """Texel indices in [0, size), -1 for black."""
    if wrap == "repeat":
        found = index % size
    elif wrap == "mirror":
        period = index % (2 * size)
        found = np.minimum(period, 2 * size - 1 - period)
    elif wrap == "clamp":
        found = np.clip(index, 0, size - 1)
    else:
        found = np.where((index < 0) | (index >= size), -1, index)
    return np.nan_to_num(found, nan=-1).astype(np.int64)


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
