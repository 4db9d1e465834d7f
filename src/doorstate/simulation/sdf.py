# SPDX-License-Identifier: Apache-2.0
"""Export of a manifest row as an SDF world for Gazebo (SDFormat 1.7): the scene's shapes and the depth camera.

The world frame is the door frame. SDFormat has capsules from 1.8 on; here each is a cylinder and two spheres.
The camera has no errors of its own: those of preset `site` are left out.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping

from doorstate.errors import ConfigError
from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.row import Row
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.capsule import Capsule
from doorstate.simulation.shading import COLORS

_FAR_M = 20.0  # beyond every camera's range: Gazebo reports clipped depth as infinite
_GLASS_TRANSPARENCY = 0.8


def sdf_world(row: Row, name: str) -> str:
    """Return the world of a row as XML text that reads back to the same numbers; sensor noise is left out.

    Raises:
        ConfigError: the camera's centre of projection is not the image's, which Gazebo does not offer.
    """
    if row.camera.cx_px is not None or row.camera.cy_px is not None:
        raise ConfigError(
            f"{name}: its camera is not centred, and Gazebo has no such camera",
            hint="use a row of another sensor",
        )
    sdf = ET.Element("sdf", version="1.7")
    world = ET.SubElement(sdf, "world", name=name)
    light = ET.SubElement(world, "light", name="sun", type="directional")
    _leaf(light, "pose", "0 0 10 0 0 0")
    _leaf(light, "direction", "-0.5 -0.4 -0.8")
    model = ET.SubElement(world, "model", name="scene")
    _leaf(model, "static", "true")
    link = ET.SubElement(model, "link", name="boxes")
    for number, box in enumerate(row.boxes()):
        name = f"{number:03d}_{box.part.name.lower()}"
        if isinstance(box, Capsule):
            _add_capsule(link, name, box)
        else:
            _add_shape(link, name, box, box.center_m, "box", {"size": _numbers(*box.size_m)})
    _add_camera(world, row.camera_pose(), row.camera)
    ET.indent(sdf)
    return ET.tostring(sdf, encoding="unicode", xml_declaration=True) + "\n"


def _add_capsule(link: ET.Element, name: str, capsule: Capsule) -> None:
    (x, y, z), (width, _, height) = capsule.center_m, capsule.size_m
    radius, reach = width / 2, (height - width) / 2
    if reach > 0:
        sizes = {"radius": _numbers(radius), "length": _numbers(2 * reach)}
        _add_shape(link, f"{name}_cylinder", capsule, (x, y, z), "cylinder", sizes)
    for end, at in (("top", z + reach), ("bottom", z - reach)):
        _add_shape(link, f"{name}_{end}", capsule, (x, y, at), "sphere", {"radius": _numbers(radius)})


def _add_shape(
    link: ET.Element,
    name: str,
    box: Box,
    center_m: tuple[float, float, float],
    shape: str,
    sizes: Mapping[str, str],
) -> None:
    for kind in ("visual", "collision"):
        element = ET.SubElement(link, kind, name=name)
        _leaf(element, "pose", _numbers(*center_m, 0.0, 0.0, box.yaw_rad))
        geometry = ET.SubElement(ET.SubElement(element, "geometry"), shape)
        for tag, text in sizes.items():
            _leaf(geometry, tag, text)
        if kind == "visual":
            material = ET.SubElement(element, "material")
            color = _numbers(*(round(level / 255, 3) for level in COLORS[box.part]), 1.0)
            _leaf(material, "ambient", color)
            _leaf(material, "diffuse", color)
            if box.material == "glass":
                _leaf(element, "transparency", str(_GLASS_TRANSPARENCY))


def _add_camera(world: ET.Element, pose: CameraPose, camera: DepthCamera) -> None:
    model = ET.SubElement(world, "model", name="depth_camera")
    _leaf(model, "static", "true")
    _leaf(model, "pose", _numbers(*pose[:3], pose.roll_rad, pose.pitch_rad, pose.yaw_rad))
    sensor = ET.SubElement(ET.SubElement(model, "link", name="link"), "sensor", name="depth", type="depth")
    _leaf(sensor, "always_on", "true")
    _leaf(sensor, "update_rate", "1")
    optics = ET.SubElement(sensor, "camera")
    _leaf(optics, "horizontal_fov", repr(math.radians(camera.hfov_deg)))
    image = ET.SubElement(optics, "image")
    _leaf(image, "width", str(camera.width))
    _leaf(image, "height", str(camera.height))
    _leaf(image, "format", "R8G8B8")
    clip = ET.SubElement(optics, "clip")
    _leaf(clip, "near", "0.05")
    _leaf(clip, "far", str(_FAR_M))


def _leaf(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, tag).text = text


def _numbers(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)
