"""Scenes that Python draws: functions of a random stream, of ten kinds, judged on what nobody arranged.

Each is an entry point of the group `simgen.scenes`, as scenes of other packages are, and a scene is the same
for all time. Depths, sizes, shapes, colours, textures and lights differ.

clutter      Kinds of drawn scenes that are full: heaps of cards, rooms, leaves.
composition  What drawn scenes are composed of: depths, objects that stand there, lamps.
desks        Kinds of drawn scenes that are arranged: solids that stand on a desk, something behind leaves.
few_solids   Kinds of drawn scenes with two or three solids before a dark backdrop.
"""
