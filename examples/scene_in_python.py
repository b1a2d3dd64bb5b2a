"""Build the paper's scene in Python, save and load it, and draw the photons of the one that ships."""

import numpy as np

import pcii
import simgen
from simgen import AreaLight, Backdrop, Material, Mesh, Scene, SceneObject, Sphere, UniformLight

shipped = simgen.load_scene("two_objects")
ball = SceneObject(
    name="ball",
    position_mm=(-45, 0, 560.7),
    rotation_deg=(-90, 0, -90),
    shape=Sphere(radius_mm=30),
    material=Material(texture="ball.png"),
)
bird = SceneObject(
    name="bird",
    position_mm=(46.5, -2, 637.5),
    rotation_deg=(0, 35, 0),
    shape=Mesh(file="bird.ply"),
    material=Material(texture="bird.png"),
)
at, towards = (-250, -450, 150), (0, 0, 590)
lamp = AreaLight(position_mm=at, target_mm=towards, width_mm=400, height_mm=400, luminance_cd_m2=2000)
scene = Scene(
    title="Tricoloured ball and toy bird",
    objects=(ball, bird),
    lights=(lamp, UniformLight(luminance_cd_m2=30)),
    backdrop=Backdrop(z_mm=3000, reflectance=(0.013, 0.013, 0.013)),
    folder=shipped.folder,  # of bird.ply and the two images
)

file = scene.save("ball_and_bird")
print(f"{file}, and beside it {', '.join(sorted(path.name for path in file.parent.glob('b*')))}")

grid = pcii.CameraGrid(
    rows=3, cols=3, pitch_mm=(16.0, 16.0), focal_mm=50.0, pixel_mm=0.28, height=128, width=128
)
counts, again = (simgen.draw_photons(each, grid, seed=1)[0] for each in (simgen.load_scene(file), shipped))
for name in "klijn":
    np.testing.assert_array_equal(getattr(counts.events, name), getattr(again.events, name))
print(f"{counts.total} photons, the same ones as of the scene that ships")
