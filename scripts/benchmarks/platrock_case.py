# SPDX-License-Identifier: GPL-3.0-or-later
"""PlatRock on the case of `simulation.py`, run by its own Python: prints RESULT, seconds, contacts, metres of a block,
and the seconds that its maps take for each, in cells of 1 m.

PlatRock reads grids and polygons with GDAL, of which there are no wheels. Nothing is read here: the grid is handed over
as numbers, so an empty module stands in for GDAL; and there are no trees. The contact code is PlatRock's own.
"""

import sys
import time
import types
from pathlib import Path

import numpy as np

DENSITY_KGPM3, DROP_M = 2650.0, 2.0


def without_gdal(folder: Path) -> None:
    """What `import platrock` asks for."""
    tool = Path(sys.executable).parent / "gdal-config"
    tool.write_text("#!/bin/sh\necho 3.8.0\n", encoding="utf-8")
    tool.chmod(0o755)
    osgeo, gdal = types.ModuleType("osgeo"), types.ModuleType("osgeo.gdal")
    osgeo.__version__ = gdal.__version__ = "3.8.0"
    osgeo.gdal = gdal
    sys.modules |= {"osgeo": osgeo, "osgeo.gdal": gdal}


def terrain_of(z: np.ndarray, objects: types.ModuleType, tools: types.ModuleType) -> object:
    """The grid of 1 m as PlatRock's triangles; `z` is [y, x]."""
    raster = tools.Raster()
    raster.ny, raster.nx = z.shape
    raster.X, raster.Y = np.arange(raster.nx) * 1.0, np.arange(raster.ny) * 1.0
    raster.cell_length, raster.xllcorner, raster.yllcorner = 1.0, 0.0, 0.0
    raster.header_data = {
        "cellsize": 1.0, "NODATA_value": -9999.0, "xllcorner": 0.0, "yllcorner": 0.0,
        "ncols": raster.nx, "nrows": raster.ny,
    }  # fmt: skip
    raster.data["Z"] = np.ascontiguousarray(z.T)
    terrain = objects.Terrain()
    terrain.default_faces_params.update(R_n=0.35, R_t=0.85, roughness=0.1, bounce_model_number=0)
    terrain.Z_raster = raster
    terrain.populate_from_Z_raster()
    terrain.precompute_datas()
    return terrain


def main() -> None:
    folder = Path(sys.argv[1])
    without_gdal(folder)
    from platrock.Common import BounceModels, RasterTools, ThreeDPostprocessings

    BounceModels.Toe_Tree_2022.__init__ = lambda self: None  # measured impacts on trees, which it would download
    from platrock.ThreeD import Objects, Simulations
    from shapely.geometry import box

    case = np.load(folder / "case.npz")
    starts, volume = case["starts"], float(case["volume"])
    simulation = Simulations.Simulation(terrain=terrain_of(case["z"], Objects, RasterTools), name="case", random_seed=1)
    simulation.rocks_start_params = [
        {
            "shapely_polygon": box(*starts.min(axis=0), *starts.max(axis=0)),
            "params": {
                "number": len(starts), "rocks_min_vol": volume, "rocks_max_vol": volume, "density": DENSITY_KGPM3,
                "z": DROP_M, "rocks_z": DROP_M, "vz": 0.0, "rocks_volumes": np.full(len(starts), volume),
            },
        }
    ]  # fmt: skip
    places = iter(starts.tolist())
    simulation.pick_rock_start_xy = lambda: next(places)
    simulation.nb_rocks = len(starts)
    begun: list[float] = []
    launch = simulation.before_rock_launch_tasks

    def timed_launch() -> None:
        begun.append(time.process_time())
        launch()

    simulation.before_rock_launch_tasks = timed_launch
    simulation.run()
    seconds = time.process_time() - begun[0]
    if simulation.status != "finished":
        raise SystemExit(f"PlatRock ended with {simulation.status}")
    contacts = np.mean([len(one) for one in simulation.output.contacts])
    ways = [np.diff(simulation.output.get_contacts_pos(i), axis=0) for i in range(len(starts))]
    metres = np.mean([np.linalg.norm(way, axis=1).sum() for way in ways])
    begin = time.process_time()
    ThreeDPostprocessings.ThreeDPostprocessing(simulation, raster_cell_length=1.0).run()
    mapped = time.process_time() - begin
    print("RESULT", seconds / len(starts), contacts, metres, mapped / len(starts))


if __name__ == "__main__":
    main()
