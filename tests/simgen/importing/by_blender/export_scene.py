"""A scene as Blender exports it, and what Blender's own rays hit: scene.glb and casts.npz beside this file.

    pip install bpy && python export_scene.py

Made with bpy 4.2.23. A subdivided mesh, image textures, a turned and a mirrored instance, a ball whose parent
is turned and scaled unevenly, a camera, two lamps; `casts.npz` has depth in mm and the name of the object at
the pixels' centres of a film of 96 x 96, over which the camera's 39.6 degrees go.
"""

from pathlib import Path

import bpy  # pyright: ignore[reportMissingImports]
import mathutils  # pyright: ignore[reportMissingImports]
import numpy as np

SIZE_PX = 96
SENSOR_MM, FOCAL_MM = 36.0, 50.0
HERE = Path(__file__).resolve().parent


def picture(name: str, colours: list[tuple[float, float, float]]) -> bpy.types.Image:
    """Four quarters of 8 x 8 pixels in these colours, from above."""
    quarters = np.ones((16, 16, 4), np.float32)
    for number, colour in enumerate(colours):
        i, j = divmod(number, 2)
        quarters[8 * i : 8 * i + 8, 8 * j : 8 * j + 8, :3] = colour
    image = bpy.data.images.new(name, 16, 16)
    image.pixels.foreach_set(quarters[::-1].ravel())
    image.pack()
    return image


def material(name: str, image: bpy.types.Image | None = None, **values: object) -> bpy.types.Material:
    """A principled surface."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    surface = made.node_tree.nodes["Principled BSDF"]
    for key, value in values.items():
        surface.inputs[key.replace("_", " ")].default_value = value
    if image is not None:
        texture = made.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        made.node_tree.links.new(texture.outputs["Color"], surface.inputs["Base Color"])
    return made


def placed(name: str, data: object, **values: object) -> bpy.types.Object:
    """An object with this data."""
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    for key, value in values.items():
        setattr(thing, key, value)
    return thing


def build() -> bpy.types.Object:
    """The scene; its camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    red, green, blue, yellow = (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)
    tiles = material("tiles", picture("tiles", [red, green, blue, yellow]), Roughness=0.6)
    paint = material("paint", picture("paint", [blue, yellow, green, red]), Roughness=0.3)
    clay = material("clay", Base_Color=(0.7, 0.3, 0.2, 1), Roughness=0.4)
    steel = material("steel", Base_Color=(0.9, 0.9, 0.9, 1), Metallic=1.0, Roughness=0.2)

    bpy.ops.mesh.primitive_cube_add(size=0.16, location=(0.02, 0.0, 0.10))
    pebble = bpy.context.object
    pebble.name = "pebble"
    pebble.data.materials.append(clay)
    pebble.data.vertices[0].co *= 1.5
    modifier = pebble.modifiers.new("smooth", "SUBSURF")
    modifier.levels = modifier.render_levels = 3

    bpy.ops.mesh.primitive_plane_add(size=1.2, location=(0, 0.2, 0))
    bpy.context.object.name = "floor"
    bpy.context.object.data.materials.append(tiles)

    bpy.ops.mesh.primitive_cube_add(size=0.06, location=(0.12, 0.03, 0.05))
    wedge = bpy.context.object
    wedge.name = "wedge"
    wedge.data.materials.append(paint)
    for vertex in wedge.data.vertices:
        if vertex.co.z > 0 and vertex.co.x > 0:
            vertex.co.z *= 0.3
    placed("turned", wedge.data, location=(-0.13, 0.02, 0.06), rotation_euler=(0.3, 0.5, 1.0))
    mirrored = {"scale": (-1.3, 1, 0.7), "rotation_euler": (0, 0, 0.4)}
    placed("mirrored", wedge.data, location=(-0.05, -0.12, 0.04), **mirrored)

    group = placed(
        "group", None, location=(0.1, -0.1, 0.02), rotation_euler=(0, 0, 0.8), scale=(1.5, 1.2, 1.5)
    )
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.025, segments=16, ring_count=8, location=(0, 0, 0.02))
    ball = bpy.context.object
    ball.name = "child.ball"
    ball.rotation_euler = (0.2, 0.4, 0)
    ball.parent = group
    ball.data.materials.append(steel)

    lens = bpy.data.cameras.new("Cam")
    lens.lens, lens.sensor_width = FOCAL_MM, SENSOR_MM
    camera = placed("Cam", lens, location=(0.1, -0.62, 0.30))
    away = mathutils.Vector((0, 0, 0.06)) - camera.location
    camera.rotation_euler = away.to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = camera
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = SIZE_PX

    for name, kind, energy in (("key", "POINT", 5.0), ("sun", "SUN", 1.0)):
        light = bpy.data.lights.new(name, kind)
        light.energy = energy
        placed(name, light, location=(0.4, -0.5, 0.8), rotation_euler=(0.5, 0.2, 0))
    bpy.context.view_layer.update()
    return camera


def cast(camera: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Planar depth in mm (+inf for a miss) and the object's name at each pixel's centre."""
    scene, graph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    z_mm = np.full((SIZE_PX, SIZE_PX), np.inf)
    names = np.full((SIZE_PX, SIZE_PX), "", dtype="U16")
    turn, origin = camera.matrix_world.to_3x3(), camera.matrix_world.translation
    slope = SENSOR_MM / FOCAL_MM / SIZE_PX
    for i, j in np.ndindex(SIZE_PX, SIZE_PX):
        ray = mathutils.Vector(((j + 0.5 - SIZE_PX / 2) * slope, (SIZE_PX / 2 - i - 0.5) * slope, -1.0))
        towards = turn @ ray
        hit, place, _, _, thing, _ = scene.ray_cast(graph, origin, towards.normalized())
        if hit:
            z_mm[i, j] = 1000 * (place - origin).dot(turn @ mathutils.Vector((0, 0, -1)))
            names[i, j] = thing.name
    return z_mm, names


if __name__ == "__main__":
    eye = build()
    choices = {"export_apply": True, "export_cameras": True, "export_lights": True}
    bpy.ops.export_scene.gltf(filepath=str(HERE / "scene.glb"), export_format="GLB", **choices)
    depth, names = cast(eye)
    np.savez_compressed(HERE / "casts.npz", z_mm=depth.astype(np.float32), name=names)
