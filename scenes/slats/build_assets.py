"""Paint picture.png, a house on a hill that is not symmetric: run it without arguments."""

import math
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT, FINER = 640, 480, 3
"""Pixels of the picture, and how many times finer it is painted."""


def picture() -> Image.Image:
    """The picture, with few enough colours for a palette."""
    page = Image.new("RGB", (WIDTH * FINER, HEIGHT * FINER))
    draw = ImageDraw.Draw(page)

    def area(points: list[tuple[float, float]], colour: tuple[int, int, int]) -> None:
        draw.polygon([(FINER * x, FINER * y) for x, y in points], fill=colour)

    for band in range(12):  # the sky
        shade = (95 + 9 * band, 150 + 6 * band, 215 + 2 * band)
        area([(0, 26 * band), (WIDTH, 26 * band), (WIDTH, 26 * band + 26), (0, 26 * band + 26)], shade)
    for ray in range(24):  # the sun, up to the left
        angle = ray * math.pi / 12
        reach = 95 if ray % 2 else 75
        tip = 120 + reach * math.cos(angle), 105 + reach * math.sin(angle)
        sides = [(120 + 42 * math.cos(angle + a), 105 + 42 * math.sin(angle + a)) for a in (-0.09, 0.09)]
        area([*sides, tip], (250, 205, 60))
    circle = [(120 + 48 * math.cos(t), 105 + 48 * math.sin(t)) for t in np.linspace(0, 2 * math.pi, 90)]
    area(circle, (250, 225, 90))
    for stripe in range(14):  # fields that follow a hill
        x = np.linspace(0, WIDTH, 80)
        top = 300 + 16 * stripe - 70 * np.sin(x / WIDTH * math.pi) * (1 - stripe / 20)
        colour = ((70, 120, 50), (125, 165, 60), (160, 150, 70))[stripe % 3]
        area([*zip(x, top, strict=True), (WIDTH, HEIGHT), (0, HEIGHT)], colour)
    for row in range(8):  # bricks
        for column in range(9):
            x, y = 390 + 20 * column + 10 * (row % 2), 235 + 13 * row
            shade = (165, 85, 60) if (3 * row + 5 * column) % 4 else (195, 120, 85)
            area([(x, y), (x + 18, y), (x + 18, y + 11), (x, y + 11)], shade)
    for row in range(6):  # roof tiles
        inset = 16 * (6 - row)
        for column in range(11):
            width = (210 - 2 * inset + 12) / 11
            x, y = 378 + inset + column * width, 150 + 14 * row
            shade = (90, 45, 45) if (row + column) % 2 else (135, 60, 50)
            area([(x, y), (x + width, y), (x + width, y + 14), (x, y + 14)], shade)
    for x, y, w, h in ((415, 260, 34, 34), (505, 260, 34, 34)):
        area([(x, y), (x + w, y), (x + w, y + h), (x, y + h)], (245, 235, 190))
        area([(x + 15, y), (x + 19, y), (x + 19, y + h), (x + 15, y + h)], (60, 45, 40))
    for post in range(16):  # a fence at the lower left
        x = 20 + 20 * post
        area([(x, 400), (x + 5, 392), (x + 10, 400), (x + 10, 460), (x, 460)], (235, 230, 220))
    return page.resize((WIDTH, HEIGHT), Image.Resampling.BOX).quantize(64, dither=Image.Dither.NONE)


def main(folder: Path = HERE) -> None:
    """Write the picture into the folder."""
    picture().save(folder / "picture.png", optimize=True)


if __name__ == "__main__":
    main()
