"""UsdPreviewSurface shader networks as materials.

Read are diffuseColor, roughness, metallic and ior: constants, textures with their transforms, and
for the base colour primvars. What a surface of ours cannot show is told in a note a material.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from limitray.material import RANGES, Material
from limitray.texture import Texture
from limitray.usd.image import load_texture

if TYPE_CHECKING:
    from pxr import Usd, UsdShade

Color = tuple[float, float, float]

GREY: Color = (0.18, 0.18, 0.18)
"""The base colour of a UsdPreviewSurface that names none."""

NEUTRAL: dict[str, float | Color] = {
    "opacity": 1.0,
    "clearcoat": 0.0,
    "displacement": 0.0,
    "useSpecularWorkflow": 0.0,
    "emissiveColor": (0.0, 0.0, 0.0),
    "normal": (0.0, 0.0, 1.0),
}
"""Inputs that are not shown, and the values with which they would not be seen anyway."""


@dataclass
class SurfaceReader:
    """Reads UsdPreviewSurface shaders at one time, each texture once; `note` takes remarks."""

    time: Usd.TimeCode
    note: Callable[[str], None]
    _textures: dict[tuple[str, ...], Texture | None] = field(default_factory=dict)

    def read(self, shader: UsdShade.Shader) -> Material:
        """The material of a shader with the id UsdPreviewSurface."""
        color = _value(shader, "diffuseColor", self.time)
        base: Color = GREY if color is None else cast(Color, tuple(float(x) for x in color))
        given: dict[str, Any] = {"base_color": base, **self._base_color(shader, base)}
        primvar = given.get("texture_primvar")
        for name, default in (("roughness", 0.5), ("metallic", 0.0), ("ior", 1.5)):
            given[name] = self._number(shader, name, default)
        for name in ("roughness", "metallic"):
            found = self._texture_of(shader, name)
            if found is None:
                continue
            texture, st = found
            if primvar not in (None, st):
                self.note(f"{shader.GetPath()}: texture of {name} ignored: on other coordinates")
                continue
            primvar = given["texture_primvar"] = st
            given[f"{name}_texture"] = texture
        hidden = [name for name in NEUTRAL if not self._is_neutral(shader, name)]
        if hidden:
            self.note(f"{shader.GetPath()}: not shown: {', '.join(hidden)}")
        return Material(**given)

    def _base_color(self, shader: UsdShade.Shader, base: Color) -> dict[str, Any]:
        """What gives the base colour besides the constant: arguments of `Material`."""
        connected = _source(shader, "diffuseColor")
        if connected is None:
            return {}
        source, _ = connected
        kind = str(source.GetShaderId())
        if kind == "UsdUVTexture":
            found = self._texture_of(shader, "diffuseColor")
            if found is not None:
                return {"texture": found[0], "texture_primvar": found[1]}
            fallback = _value(source, "fallback", self.time)
            return {} if fallback is None else {"base_color": tuple(map(float, fallback[:3]))}
        if kind.startswith("UsdPrimvarReader_"):
            name = _value(source, "varname", self.time)
            fallback = _value(source, "fallback", self.time)
            color = base if fallback is None else tuple(map(float, fallback))
            return {"color_primvar": str(name), "base_color": color}
        self.note(f"{source.GetPath()}: ignored: a shader {kind} gives the base colour")
        return {}

    def _number(self, shader: UsdShade.Shader, name: str, default: float) -> float:
        """A constant input, brought into the range of `Material`."""
        found = _value(shader, name, self.time)
        value = default if found is None else float(found)
        low, high = RANGES[name]
        if not low <= value <= high:
            shown = min(max(value, low), high) if value == value else default
            self.note(f"{shader.GetPath()}: {name} {value:g} is shown as {shown:g}")
            return shown
        return value

    def _is_neutral(self, shader: UsdShade.Shader, name: str) -> bool:
        if _source(shader, name) is not None:
            return False
        value = _value(shader, name, self.time)
        return value is None or bool(np.allclose(value, NEUTRAL[name]))

    def _texture_of(self, shader: UsdShade.Shader, name: str) -> tuple[Texture, str] | None:
        """The texture that an input comes from, and the primvar it is looked up at."""
        connected = _source(shader, name)
        if connected is None:
            return None
        source, output = connected
        if source.GetShaderId() != "UsdUVTexture" or output == "a":
            if name != "diffuseColor" or output == "a":
                self.note(f"{shader.GetPath()}: {name} ignored: not a colour channel of an image")
            return None
        texture = self._texture(source)
        if texture is None:
            return None
        st, transform = self._coordinates(source)
        scale, bias = (
            np.asarray(_value(source, key, self.time) or [default] * 4, float)[:3]
            for key, default in (("scale", 1.0), ("bias", 0.0))
        )
        channel = "rgb".index(output) if len(output) == 1 else None
        if channel is not None:
            scale, bias = scale[channel].repeat(3), bias[channel].repeat(3)
        return texture.adjusted(transform, scale, bias, channel), st

    def _coordinates(self, texture: UsdShade.Shader) -> tuple[str, NDArray[np.float64]]:
        """The primvar of a texture, and the affine map (2, 3) that is applied to it first."""
        total = np.eye(3)
        connected = _source(texture, "st")
        while connected is not None and connected[0].GetShaderId() == "UsdTransform2d":
            total = total @ _transform_2d(connected[0], self.time)
            connected = _source(connected[0], "in")
        name: Any = None
        if connected is not None and connected[0].GetShaderId() == "UsdPrimvarReader_float2":
            name = _value(connected[0], "varname", self.time)
        elif connected is not None:
            self.note(f"{connected[0].GetPath()}: ignored: no UsdPrimvarReader_float2")
        return str(name or "st"), total[:2]

    def _texture(self, shader: UsdShade.Shader) -> Texture | None:
        attribute = _source_attribute(shader, "file")
        asset = attribute.Get(self.time) if attribute else None
        if attribute is None or asset is None:
            self.note(f"{shader.GetPath()}: ignored: has no file")
            return None
        options = {
            name: str(_value(shader, name, self.time) or fallback)
            for name, fallback in (
                ("wrapS", "useMetadata"),
                ("wrapT", "useMetadata"),
                ("sourceColorSpace", "auto"),
            )
        }
        key = (str(asset.resolvedPath or asset.path), *options.values())
        if key not in self._textures:
            try:
                self._textures[key] = load_texture(asset, attribute, options)
            except FileNotFoundError as error:
                self.note(f"{shader.GetPath()}: texture ignored: no such file: {error.filename}")
                self._textures[key] = None
            except (OSError, ValueError) as error:
                self.note(f"{shader.GetPath()}: texture ignored: {error}")
                self._textures[key] = None
        return self._textures[key]


def _transform_2d(shader: UsdShade.Shader, time: Usd.TimeCode) -> NDArray[np.float64]:
    """The matrix (3, 3) of a UsdTransform2d: scaled, turned anticlockwise, then moved."""
    scale = _value(shader, "scale", time) or (1.0, 1.0)
    angle = np.radians(_value(shader, "rotation", time) or 0.0)
    moved = _value(shader, "translation", time) or (0.0, 0.0)
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(3)
    matrix[:2, :2] = np.array([[c, -s], [s, c]]) * np.asarray(scale, float)
    matrix[:2, 2] = moved
    return matrix


def _source_attribute(shader: UsdShade.Shader, name: str) -> Usd.Attribute | None:
    """The attribute that an input of a shader has its value from, through material interfaces."""
    from pxr import UsdShade

    shader_input = shader.GetInput(name)
    if not shader_input:
        return None
    found = UsdShade.Utils.GetValueProducingAttributes(shader_input)
    return found[0] if found else None


def _value(shader: UsdShade.Shader, name: str, time: Usd.TimeCode) -> Any:
    """An input's value; None if it has none or comes from another shader."""
    from pxr import UsdShade

    attribute = _source_attribute(shader, name)
    if attribute is None or UsdShade.Output.IsOutput(attribute):
        return None
    return attribute.Get(time)


def _source(shader: UsdShade.Shader, name: str) -> tuple[UsdShade.Shader, str] | None:
    """The shader that an input is connected to, and the name of the output."""
    from pxr import UsdShade

    attribute = _source_attribute(shader, name)
    if attribute is None or not UsdShade.Output.IsOutput(attribute):
        return None
    return UsdShade.Shader(attribute.GetPrim()), str(UsdShade.Output(attribute).GetBaseName())
