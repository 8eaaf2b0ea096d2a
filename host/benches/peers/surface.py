#!/usr/bin/env python3
"""Surfaces by Open3D, MeshLab and VTK on the clouds of `cargo bench -p host --bench surface`, scored by the same program.

    pip install open3d pymeshlab vtk
    python3 host/benches/peers/surface.py [FOLDER] [--clouds one-5436,solid-5436] [--slow]

Writes the clouds to FOLDER (by default target/peers), lets each method make its mesh in a process of its own, which takes
the time of the method and the growth of the peak of resident memory over the loaded cloud, and prints the table with ours
beside theirs. Methods that take minutes are left out at 500,000 points without --slow.
"""

import argparse
import json
import pathlib
import resource
import subprocess
import sys
import time

NEIGHBOURS = 20
POISSON_DEPTH = 8


def open3d_cloud(path):
    import open3d as o3d

    return o3d, o3d.io.read_point_cloud(str(path))


def open3d_poisson(path, out, voxel_m=None):
    o3d, cloud = open3d_cloud(path)
    begin = start()
    if voxel_m:
        cloud = cloud.voxel_down_sample(voxel_m)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    cloud.orient_normals_consistent_tangent_plane(NEIGHBOURS)
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=POISSON_DEPTH)
    took = end(begin)
    o3d.io.write_triangle_mesh(str(out), mesh)
    return took


def open3d_poisson_thinned(path, out):
    return open3d_poisson(path, out, voxel_m=0.0005)


def open3d_ball_pivoting(path, out):
    o3d, cloud = open3d_cloud(path)
    begin = start()
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    cloud.orient_normals_consistent_tangent_plane(NEIGHBOURS)
    spacing = sorted(cloud.compute_nearest_neighbor_distance())[len(cloud.points) // 2]
    radii = o3d.utility.DoubleVector([spacing * factor for factor in (2.0, 3.0, 4.5)])
    mesh = o3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii)
    took = end(begin)
    o3d.io.write_triangle_mesh(str(out), mesh)
    return took


def meshlab(path, out, method):
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    begin = start()
    meshes.compute_normal_for_point_clouds(k=NEIGHBOURS)
    method(meshes)
    took = end(begin)
    meshes.save_current_mesh(str(out), binary=True, save_vertex_normal=False, save_vertex_color=False)
    return took


def meshlab_poisson(path, out):
    return meshlab(
        path, out, lambda m: m.generate_surface_reconstruction_screened_poisson(depth=POISSON_DEPTH, preclean=True)
    )


def meshlab_apss(path, out):
    return meshlab(path, out, lambda m: m.generate_marching_cubes_apss(resolution=200))


def meshlab_rimls(path, out):
    return meshlab(path, out, lambda m: m.generate_marching_cubes_rimls(resolution=200))


def vtk_hoppe(path, out):
    import vtk

    reader = vtk.vtkPLYReader()
    reader.SetFileName(str(path))
    reader.Update()
    cloud = reader.GetOutput()
    low_high = cloud.GetBounds()
    sides = [low_high[2 * i + 1] - low_high[2 * i] for i in range(3)]
    faces = 2 * (sides[0] * sides[1] + sides[1] * sides[2] + sides[2] * sides[0])
    begin = start()
    distance = vtk.vtkSurfaceReconstructionFilter()
    distance.SetInputData(cloud)
    distance.SetNeighborhoodSize(NEIGHBOURS)
    distance.SetSampleSpacing(max((faces / cloud.GetNumberOfPoints()) ** 0.5, 0.00035))
    contour = vtk.vtkContourFilter()
    contour.SetInputConnection(distance.GetOutputPort())
    contour.SetValue(0, 0.0)
    contour.Update()
    took = end(begin)
    writer = vtk.vtkPLYWriter()
    writer.SetFileName(str(out))
    writer.SetInputConnection(contour.GetOutputPort())
    writer.Write()
    return took


METHODS = {
    "open3d-poisson": open3d_poisson,
    "open3d-voxel-poisson": open3d_poisson_thinned,
    "open3d-ball-pivoting": open3d_ball_pivoting,
    "meshlab-poisson": meshlab_poisson,
    "meshlab-apss": meshlab_apss,
    "meshlab-rimls": meshlab_rimls,
    "vtk-hoppe": vtk_hoppe,
}
SLOW_AT_500000 = {"open3d-poisson", "open3d-ball-pivoting", "meshlab-apss", "meshlab-rimls", "vtk-hoppe"}


def peak_mb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def start():
    return time.perf_counter(), peak_mb()


def end(begin):
    return {"seconds": time.perf_counter() - begin[0], "peak_mb": peak_mb() - begin[1]}


def bench(*arguments):
    command = ["cargo", "bench", "-q", "-p", "host", "--bench", "surface", "--", *arguments]
    subprocess.run(command, check=True, cwd=pathlib.Path(__file__).parents[3])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", default=pathlib.Path(__file__).parents[3] / "target" / "peers")
    parser.add_argument("--clouds", help="names, separated by commas; all by default")
    parser.add_argument("--slow", action="store_true", help="all methods at 500,000 points too")
    parser.add_argument("--run", nargs=3, metavar=("METHOD", "CLOUD", "MESH"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.run:
        method, cloud, mesh = args.run
        pathlib.Path(mesh).with_suffix(".json").write_text(json.dumps(METHODS[method](cloud, mesh)))
        return
    folder = pathlib.Path(args.folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    bench("--write", str(folder))
    clouds = sorted(path for path in folder.glob("*.ply") if path.name.count(".") == 1)
    wanted = args.clouds.split(",") if args.clouds else [path.stem for path in clouds]
    for cloud in clouds:
        if cloud.stem not in wanted:
            continue
        for method in METHODS:
            mesh = folder / f"{cloud.stem}.{method}.ply"
            if mesh.exists() or ("500000" in cloud.stem and method in SLOW_AT_500000 and not args.slow):
                continue
            print(f"{cloud.stem} {method}", file=sys.stderr)
            command = [sys.executable, __file__, str(folder), "--run", method, str(cloud), str(mesh)]
            if subprocess.run(command).returncode != 0:
                mesh.unlink(missing_ok=True)
                print(f"{method} failed on {cloud.stem}", file=sys.stderr)
    bench("--score", str(folder))


if __name__ == "__main__":
    main()
