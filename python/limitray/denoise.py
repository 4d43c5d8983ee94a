"""Denoising by Intel Open Image Denoise; the only file that imports pyoidn (an extra)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def load_denoiser() -> Any:
    """The module pyoidn; raises ValueError that names the extra if it is not installed."""
    try:
        import pyoidn  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        raise ValueError("denoise needs pyoidn: pip install 'limitray[denoise]'") from None
    return pyoidn


def denoised(
    color: NDArray[np.float32], albedo: NDArray[np.float32], normals: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The picture without noise; all are (height, width, 3), colours linear."""
    layers = {"albedo": np.clip(albedo, 0, 1), "normal": np.clip(normals, -1, 1)}
    clean = load_denoiser().denoise(color, hdr=True, **layers)
    return np.asarray(clean, np.float32)
