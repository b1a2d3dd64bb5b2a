from .charts import accuracy_chart as accuracy_chart, calibration_chart as calibration_chart
from .charts import colour_bar_uri as colour_bar_uri, draw_accuracy as draw_accuracy
from .charts import figure_bytes as figure_bytes, figure_uri as figure_uri, hide_frame as hide_frame
from .charts import in_style as in_style, new_figure as new_figure, PLACES as PLACES
from .pages import emphasised as emphasised, NOT_KNOWN as NOT_KNOWN, render_page as render_page
from .pages import text_table as text_table
from .pictures import agreement_image as agreement_image, block_px as block_px, DEPTH_COLOURS as DEPTH_COLOURS
from .pictures import drawing_uri as drawing_uri, ERROR_COLOURS as ERROR_COLOURS
from .pictures import exposed as exposed, filled_means as filled_means, map_image as map_image
from .pictures import mask_image as mask_image, photo_uri as photo_uri, photon_picture as photon_picture
from .pictures import SHARE_COLOURS as SHARE_COLOURS, smoothed as smoothed, smoothing_for as smoothing_for
from .pictures import to_srgb8 as to_srgb8, white_level as white_level, write_png as write_png
from .plots import draw as draw, draw_depth as draw_depth, picture_html as picture_html
