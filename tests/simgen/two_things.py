"""A scene of a ball and a card, made in Python; and one that names a file."""

from simgen import Card, Material, Scene, SceneObject, Sphere, UniformLight

RED = Material(reflectance=(0.8, 0.1, 0.1))
BALL = SceneObject(name="ball", position_mm=(10, 0, 540), shape=Sphere(radius_mm=30), material=RED)
CARD = SceneObject(name="card", position_mm=(0, 5, 620), shape=Card(width_mm=9, height_mm=8), material=RED)
SKY = UniformLight(luminance_cd_m2=100)
SCENE = Scene(title="Two things", objects=(BALL, CARD), lights=(SKY,), planes_mm=(540,))
NAMED = SCENE.replace("ball", material=Material(texture="a.png"))
