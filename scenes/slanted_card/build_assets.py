"""Draw scale.png, a scale of depths from 500 to 700 mm for the slanted card: run it without arguments."""

from pathlib import Path

import matplotlib as mpl
from PIL import Image, ImageDraw, ImageFont

HERE = Path(__file__).resolve().parent
NEAR_MM, FAR_MM = 500, 700
WIDTH, HEIGHT = 1500, 150
"""Pixels."""
INK, PAPER = 30, 240


def scale() -> Image.Image:
    """A mark every 2 mm of depth, longer every 10 mm, a number every 20 mm; grey."""
    page = Image.new("L", (WIDTH, HEIGHT), PAPER)
    draw = ImageDraw.Draw(page)
    font = ImageFont.truetype(
        str(Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"),
        size=52,
        layout_engine=ImageFont.Layout.BASIC,
    )
    for z_mm in range(NEAR_MM, FAR_MM + 1, 2):
        x = (z_mm - NEAR_MM) * WIDTH / (FAR_MM - NEAR_MM)
        length = 60 if z_mm % 20 == 0 else 45 if z_mm % 10 == 0 else 25
        draw.rectangle([x - 2, 0, x + 1, length], fill=INK)
        if z_mm % 20 == 0 and NEAR_MM < z_mm < FAR_MM:
            draw.text((x, 100), str(z_mm), fill=INK, font=font, anchor="mm")
    return page


def main(folder: Path = HERE) -> None:
    """Write the picture into the folder."""
    scale().save(folder / "scale.png", optimize=True)


if __name__ == "__main__":
    main()
