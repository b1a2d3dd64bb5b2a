"""Draw every shipped scene into docs/gallery/ and list them in docs/gallery.md: `make gallery`."""

from pathlib import Path

from simgen.app import preview
from simgen.spec import load_recipe, load_scene

DOCS = Path(__file__).resolve().parent
SCENES, RECIPES = DOCS.parent / "scenes", DOCS.parent / "data_recipes"
SAMPLES_PER_PIXEL = 128
DOTS_PER_INCH = 62
"""Keeps a picture below 60 kB."""

HEAD = """# Scenes

What ships in `scenes/`: `simgen check NAME` and `simgen preview NAME -o NAME.png` take a scene by its name,
`simgen generate NAME -o out/NAME` makes the data of a recipe. Each scene.toml has comments
to learn from. Pictures from the virtual centre of the paper's camera grid; the frame in the left one is what
the others show enlarged. All of
this page is made by `make gallery`.
"""


def scene_names() -> list[str]:
    """Of the scenes that ship, the paper's first."""
    names = {file.parent.name for file in SCENES.glob("*/scene.toml")}
    return sorted(names, key=lambda name: (name != "two_objects", name))


def page() -> str:
    """The text of gallery.md: title, purpose, recipes and picture of each scene."""
    recipes: dict[str, list[str]] = {}
    for file in sorted(RECIPES.glob("*.toml")):
        recipe, _ = load_recipe(str(file))
        recipes.setdefault(recipe.scene, []).append(f"`{file.stem}`")
    parts = [HEAD]
    for name in scene_names():
        scene = load_scene(str(SCENES / name))
        purpose = " ".join(scene.description.split())
        recipes_text = f" Recipes: {', '.join(recipes[name])}." if name in recipes else ""
        parts.append(f"## {name}\n\n{purpose}{recipes_text}\n\n![{scene.title}](gallery/{name}.jpg)\n")
    return "\n".join(parts)


def main() -> None:
    """Write all pictures and the page."""
    folder = DOCS / "gallery"
    folder.mkdir(exist_ok=True)
    for name in scene_names():
        picture = preview(SCENES / name, samples_per_pixel=SAMPLES_PER_PIXEL)
        picture.write(folder / f"{name}.jpg", DOTS_PER_INCH)
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
