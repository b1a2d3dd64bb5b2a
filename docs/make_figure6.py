"""Draw docs/figure6.jpg from a report of the paper's scene: `python docs/make_figure6.py RESULTS`.

RESULTS is what `pcii run DATASET -o RESULTS` makes of `simgen generate data_recipes/paper.toml -o DATASET`.
"""

import base64
import io
import re
import sys
from html import unescape
from pathlib import Path

from matplotlib import get_data_path
from PIL import Image, ImageDraw, ImageFont

PANEL = re.compile(r'<img src="data:image/(?:png|webp);base64,([^"]+)" alt="([^"]+)"')
PANELS, COLUMNS = 8, 2
WIDTH_PX, CAPTION_PX, GAP_PX = 432, 28, 12
INK = (75, 85, 99)


def main(results: Path) -> None:
    """Write the picture beside this script: the panels of the report's Figure 6 with their captions."""
    page = (results / "report.html").read_text(encoding="utf-8")
    figure = page[page.index("Figure 6") : page.index("Figure 7")]
    panels = [
        (Image.open(io.BytesIO(base64.b64decode(data))), unescape(text))
        for data, text in PANEL.findall(figure)
    ]
    if len(panels) != PANELS:
        raise SystemExit(
            f"{results}: Figure 6 has {len(panels)} panels, not {PANELS}; keep full-light images and truth"
        )
    width, height = panels[0][0].size
    cell_W, cell_H = WIDTH_PX + GAP_PX, round(WIDTH_PX * height / width) + CAPTION_PX
    sheet = Image.new("RGB", (COLUMNS * cell_W - GAP_PX, PANELS // COLUMNS * cell_H), "white")
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.truetype(str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), 11)
    for number, (panel, caption) in enumerate(panels):
        x, y = number % COLUMNS * cell_W, number // COLUMNS * cell_H
        small = panel.convert("RGB").resize((WIDTH_PX, cell_H - CAPTION_PX), Image.Resampling.LANCZOS)
        sheet.paste(small, (x, y))
        draw.text((x, y + cell_H - CAPTION_PX + 6), caption.removesuffix(", key below"), INK, font)
    sheet.save(Path(__file__).with_name("figure6.jpg"), quality=88)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
