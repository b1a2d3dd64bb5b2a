"""The file transforms.json of neural reconstruction (nerfstudio, Instant NGP, visionsim), both ways.

Its cameras have the axes of OpenGL: X right, Y up, looking along -Z, in metres. Its world is ours with Y up:
a point (X, Y, Z) mm of a dataset is (X, -Y, -Z) / 1000 there, which is right-handed too.

camera_poses     Poses of a dataset's cameras as such a file has them, and depths ahead of these cameras.
film_sizes       The camera grid of a file: poses give pitch and shear, one length of the film all the others.
grid_of_poses    The plane grid of parallel cameras that poses are of, whichever way it stands in the world.
lattice_fit      Evenly spaced numbers among measured ones, a few of which may be wrong.
parsed_members   Members of JSON objects of strangers, checked one by one.
transforms_file  A transforms.json that was read and checked: poses, focal length, principal points, paths.
written_members  What a dataset says in such a file: intrinsics, and a frame for each camera.
"""
