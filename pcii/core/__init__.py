"""Types of data, and what they rest on: Bayer patterns, camera geometry, focal planes, sRGB.

arrays         Checks that every type makes of its arrays.
bayer          Bayer colour filter arrays: which colour each pixel sees.
camera_grid    The grid of cameras: where they stand, how they see.
estimates      What methods answer, and how right that was: in-focus masks, depth maps, scores.
focal_planes   Focal planes: the depths of sections, and by how much the views shift for each.
geometry       Parallel-camera geometry: where a point appears, and its disparity.
images         Elemental images: the radiance of every view.
photon_counts  Photon counts: what a camera delivers when light is scarce, as sparse events or as a dense
               stack.
section_stack  Sections: the scene reconstructed at several depths, with how many samples meet at each
               voxel.
srgb           Encoding of linear values as sRGB (IEC 61966-2-1), for pictures on screens.
truth          What is really there, as far as a dataset knows it.
"""
