"""Run time against error, side by side in one run; `make bench` measures, draws and prints it.

Every study of `studies` gives rows and ratios (`results`, `timing`, `machine`), a figure (`figures`) and a
part of the page (`page`); `guard` compares ratios. Pages quote figures of these studies, of methods on the
paper's scene (`paper_scene`) and of the public benchmark (`quoted`). `peers` holds what ours is compared
with. `depth_constants` is a command of its own, which prints what the constants of depth change.
"""
