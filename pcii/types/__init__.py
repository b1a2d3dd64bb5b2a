"""Types of data, and what they rest on: Bayer patterns, camera geometry, focal planes.

array_labels   What every stored array is: the names of its axes, its meaning and its unit.
arrays         What all types share: checks of arrays, and how a value is drawn.
bayer          Bayer colour filter arrays: which colour each pixel records.
camera_grid    The grid of cameras: positions and intrinsic parameters.
estimates      Results of methods, and their scores: in-focus masks, depth maps, measures of accuracy.
focal_planes   Focal planes: the depths of sections, and by how much the views shift for each.
geometry       Geometry of parallel cameras: the image of a point, disparity and depth.
images         Elemental images: the radiance of every view.
photon_counts  Photon counts of the elemental images, as sparse events or as a dense stack, and their frames.
photon_limit   The light of a dataset, and photon limiting of radiance (Muniraj et al. 2017, Eq. 1).
section_stack  Sections: the scene reconstructed at several depths, with the number of samples of each
               voxel.
truth          Ground truth of a dataset: depth, objects and surfaces, and the origin of each photon.
"""
