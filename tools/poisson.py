#!/usr/bin/env python3
"""A dense screened-Poisson mesh of a point cloud, for `demeter eval fit --poisson`; the program never needs it.

Install: python3 -m venv .cache/poisson && .cache/poisson/bin/pip install pymeshlab==2025.7.post1
Run:     .cache/poisson/bin/python tools/poisson.py CLOUD.ply MESH.obj

MeshLab's filters, Kazhdan and Hoppe's method, as a user would run them: normals from 12 neighbours, octree depth 8, then
what the reconstruction invents far from any point is cut off at 1 % of the diagonal, as its thin surfaces need.
"""

import sys

import pymeshlab

meshes = pymeshlab.MeshSet(verbose=False)
meshes.load_new_mesh(sys.argv[1])
meshes.compute_normal_for_point_clouds(k=12)
meshes.generate_surface_reconstruction_screened_poisson(depth=8)
meshes.compute_scalar_by_distance_from_another_mesh_per_vertex(measuremesh=1, refmesh=0, signeddist=False)
diagonal = meshes.mesh(0).bounding_box().diagonal()
meshes.compute_selection_by_condition_per_vertex(condselect=f"q > {0.01 * diagonal}")
meshes.meshing_remove_selected_vertices()
meshes.save_current_mesh(sys.argv[2], save_vertex_normal=False)
