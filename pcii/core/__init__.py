"""What everything rests on: types, Bayer masks, geometry, errors, progress, compiled loops, safe files.

arrays          Checks that every type makes of its arrays.
bayer           Bayer colour filter arrays: which colour each pixel sees.
camera_grid     The grid of cameras: where they stand, how they see.
compiled_loops  How loops are compiled: with Numba, which needs no system library.
console         How the commands behave: one sentence for bad input, progress on a terminal, plain lines
                in a log.
errors          The one exception that means: what you gave us cannot be used, and here is why.
estimates       What methods answer, and how right that was: in-focus masks, depth maps, scores.
focal_planes    Focal planes: the depths of sections, and by how much the views shift for each.
geometry        Parallel-camera geometry: where a point appears, and its disparity.
images          Elemental images: the radiance of every view.
photon_counts   Photon counts: what a camera delivers when light is scarce, as sparse events or as a dense
                stack.
plain_text      Names that others chose, shown as text: nothing in them is carried out, and nothing is
                hidden.
safe_files      Writing that survives a kill: whatever has its final name is whole.
section_stack   Sections: the scene reconstructed at several depths, with how many samples meet at each
                voxel.
short_form      What values with large contents say of themselves: one line, and in notebooks a small
                table.
truth           What is really there, as far as a dataset knows it.
"""
