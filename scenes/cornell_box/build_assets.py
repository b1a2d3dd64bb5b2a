"""Make the Cornell box: a Mitsuba scene of its published measures, and the scene that is imported of it.

Cornell University Program of Computer Graphics, "The Cornell Box: Data", 1998: corners in mm with Y up,
spectra of paints and lamp, here every 20 nm. Run the script without arguments: it writes cornell_box.xml with
its OBJ meshes, scene.toml and PLY meshes beside itself.
"""

import shutil
import tempfile
from pathlib import Path

import numpy as np

import simgen
from simgen.base.toml_layout import toml_text

TITLE = "The Cornell box, imported from Mitsuba's XML"
DESCRIPTION = """
The box of the Cornell University Program of Computer Graphics (1984), by its published measures: two white
blocks at 865 to 1200 mm between walls of measured paints, under one warm lamp. Light that walls throw at each
other colours it. Made as a Mitsuba scene by build_assets.py, which imports it as `simgen import-scene` does.
"""
PLANES_MM = (875.0, 1070.0, 1359.0)
WAVELENGTHS_NM = range(400, 701, 20)
WHITE = (343, 687, 745, 765, 745, 747, 739, 743, 733, 764, 740, 744, 712, 707, 751, 737)
RED = (40, 50, 59, 62, 60, 58, 56, 59, 67, 99, 287, 513, 609, 638, 642, 642)
GREEN = (92, 95, 97, 104, 125, 285, 435, 441, 337, 250, 160, 126, 114, 120, 144, 159)
"""Reflectances in thousandths, of the paints of the box."""
LAMP = {400: 0.0, 500: 8.0, 600: 15.6, 700: 18.4}
Quad = list[tuple[float, float, float]]
SHORT: list[Quad] = [
    [(130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)],
    [(290, 0, 114), (290, 165, 114), (240, 165, 272), (240, 0, 272)],
    [(130, 0, 65), (130, 165, 65), (290, 165, 114), (290, 0, 114)],
    [(82, 0, 225), (82, 165, 225), (130, 165, 65), (130, 0, 65)],
    [(240, 0, 272), (240, 165, 272), (82, 165, 225), (82, 0, 225)],
]
TALL: list[Quad] = [
    [(423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)],
    [(423, 0, 247), (423, 330, 247), (472, 330, 406), (472, 0, 406)],
    [(472, 0, 406), (472, 330, 406), (314, 330, 456), (314, 0, 456)],
    [(314, 0, 456), (314, 330, 456), (265, 330, 296), (265, 0, 296)],
    [(265, 0, 296), (265, 330, 296), (423, 330, 247), (423, 0, 247)],
]
SURFACES: dict[str, tuple[str, list[Quad]]] = {
    "floor": ("white", [[(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]]),
    "ceiling": ("white", [[(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]]),
    "back-wall": ("white", [[(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)]]),
    "right-wall": ("green", [[(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]]),
    "left-wall": ("red", [[(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)]]),
    "short-block": ("white", SHORT),
    "tall-block": ("white", TALL),
    # A millimetre below the ceiling, in which the real one is a hole.
    "lamp": ("black", [[(343, 547.8, 227), (343, 547.8, 332), (213, 547.8, 332), (213, 547.8, 227)]]),
}


def obj(quads: list[Quad]) -> str:
    """Quadrangles as an OBJ file."""
    corners = "".join(f"v {x:g} {y:g} {z:g}\n" for quad in quads for x, y, z in quad)
    faces = (4 * np.arange(len(quads))[:, None] + [1, 2, 3, 4]).tolist()
    return corners + "".join(f"f {' '.join(map(str, face))}\n" for face in faces)


def spectrum(name: str, values: dict[int, float]) -> str:
    """An element of the XML."""
    pairs = ", ".join(f"{wavelength}:{value:g}" for wavelength, value in values.items())
    return f'<spectrum name="{name}" value="{pairs}"/>'


def scene_xml() -> str:
    """The Mitsuba scene."""
    lines = ['<scene version="3.0.0">']
    lines += ['  <sensor type="perspective" id="front">', '    <float name="fov" value="39.3077"/>']
    lines += ['    <transform name="to_world">']
    lines += ['      <lookat origin="278, 273, -800" target="278, 273, 0" up="0, 1, 0"/>', "    </transform>"]
    lines += ["  </sensor>"]
    for name, values in {"white": WHITE, "red": RED, "green": GREEN}.items():
        paint = {nm: value / 1000 for nm, value in zip(WAVELENGTHS_NM, values, strict=True)}
        paint = {360: paint[400], **paint, 830: paint[700]}  # beyond the ends Mitsuba takes them for black
        lines += [
            f'  <bsdf type="diffuse" id="{name}">',
            f"    {spectrum('reflectance', paint)}",
            "  </bsdf>",
        ]
    lines += ['  <bsdf type="diffuse" id="black">', '    <rgb name="reflectance" value="0"/>', "  </bsdf>"]
    for name, (paint_name, _) in SURFACES.items():
        lines += [f'  <shape type="obj" id="{name}">', f'    <string name="filename" value="{name}.obj"/>']
        lines += [f'    <ref id="{paint_name}"/>']
        if name == "lamp":
            lines += ['    <emitter type="area">', f"      {spectrum('radiance', LAMP)}", "    </emitter>"]
        lines += ["  </shape>"]
    return "\n".join([*lines, "</scene>", ""])


def main(folder: Path) -> None:
    """Write the Mitsuba scene and ours."""
    (folder / "cornell_box.xml").write_text(scene_xml(), encoding="utf-8")
    for name, (_, quads) in SURFACES.items():
        (folder / f"{name}.obj").write_text(obj(quads), encoding="utf-8")
    with tempfile.TemporaryDirectory() as near:
        said = simgen.import_scene(folder / "cornell_box.xml", Path(near) / "scene", unit="mm")
        for file in said.folder.iterdir():
            shutil.copyfile(file, folder / file.name)
    fields = {"title": TITLE, "description": DESCRIPTION.strip(), "planes_mm": PLANES_MM}
    scene = simgen.load_scene(folder).change(**fields)
    comments = ["Written by build_assets.py, which imports cornell_box.xml; lengths in mm."]
    (folder / "scene.toml").write_text(toml_text(scene, comments), encoding="utf-8")


if __name__ == "__main__":
    main(Path(__file__).resolve().parent)
