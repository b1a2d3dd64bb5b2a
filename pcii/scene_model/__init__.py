"""One model of the scene: opaque surfaces at every depth, one energy, one solver.

energy           The energy of a scene of opaque surfaces: how badly they explain all photons, and what they
                 cost.
parameters       The numbers of the scene model, in one place.
proposals        Other labellings that the energy may prefer, each in pieces that it may take or leave.
rate_kernels     Compiled: how many photons surfaces send, predicted for each photon from all others around
                 it.
ray_kernels      Compiled: which surface a ray of a camera meets first, and how many pixels of all cameras
                 see a cell.
rays             Rays of photons through a ladder of depths, in cells of the virtual centre.
solver           The search for the labelling of least energy: from several starts, proposal by proposal.
starts           Labellings to start the search from, by the posterior probability of depth.
surfaces         Surfaces of a labelling: connected cells, and what outlines, surfaces and roughness cost.
"""
