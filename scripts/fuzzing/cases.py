# SPDX-License-Identifier: GPL-3.0-or-later
"""What is damaged, and who reads it."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import examples
import kept_chunks
import maps
import numpy as np
import shown
import simulations
from examples import CAMERAS, DATA, FOOTAGE, SHIFT, head_of
from rockfall.core.cli import main


@dataclass(frozen=True)
class Case:
    """A set of files, those of them that are damaged, and what is done with them.

    Attributes
    ----------
    read : given the folder; the exit status of a command, anything else of a reader.
    slow : so slow that it is left out of a short run.
    """

    files: Mapping[str, bytes]
    damaged: tuple[str, ...]
    read: Callable[[Path], object]
    command: bool = False
    slow: bool = False


def _finite(surface: object) -> object:
    """A surface or cloud whose numbers are such as can be computed with."""
    points = getattr(surface, "vertices", getattr(surface, "points", None))
    assert points is not None
    assert np.isfinite(points).all(), "a coordinate is not finite"
    assert np.abs(points).max() < 1e10, "a coordinate is absurd"
    return surface


def _ran(*words: str, out: bool = True) -> Callable[[Path], object]:
    def run(folder: Path) -> int:
        arguments = [word.replace("@", f"{folder}/") for word in words]
        return main([*arguments, *(["--out", str(folder / "out")] if out else [])])

    return run


def cases(folder: Path, quick: bool = False) -> dict[str, Case]:
    """Name → case; `folder` is for files that libraries write only to a disc. `quick` makes none that must simulate."""
    terrains = examples.terrain_files(folder)
    found = {**_terrains(terrains), **_tables(), **_videos(), **_projects(terrains["b.ply"]), **_coloured()}
    (folder / "impacts.csv").write_bytes(examples.IMPACTS)
    main(["merge", str(folder / "impacts.csv"), "--out", str(folder / "package")])
    package = {f"package/{path.name}": path.read_bytes() for path in (folder / "package").glob("*.[cj]s*")}
    found["package"] = Case(package, tuple(package), lambda at: _package(at / "package"))
    if not quick:
        kept = kept_chunks.files(terrains["b.ply"], folder / "chunks")
        on = kept_chunks.reader(terrains["b.ply"], folder / "chunks")
        found["kept chunks"] = Case(kept, tuple(kept), on, slow=True)
    shutil.rmtree(folder, ignore_errors=True)
    found |= {name: Case(maps.files(), damaged, read) for name, (damaged, read) in maps.readers().items()}
    return found | _simulations(terrains["b.ply"]) | _shown(terrains["b.ply"], folder) | _commands(terrains["b.ply"])


def _package(path: Path) -> object:
    from rockfall.core.exchange.datapackage import read_package

    return read_package(path)


def _terrains(files: dict[str, bytes]) -> dict[str, Case]:
    from rockfall.core.terrain.ply_attributes import read_ply_attribute
    from rockfall.core.terrain.readers import inspect_terrain, read_terrain

    found = {}
    for name, data in files.items():
        found[f"terrain {name}"] = Case(
            {name: data}, (name,), lambda at, name=name: _finite(read_terrain(at / name)), slow=name == "b.laz"
        )
        found[f"inspect {name}"] = Case({name: data}, (name,), lambda at, name=name: inspect_terrain(at / name))
    found["attribute"] = Case(
        {"b.ply": files["b.ply"]}, ("b.ply",), lambda at: read_ply_attribute(at / "b.ply", "zone")
    )
    return found


def _coloured() -> dict[str, Case]:
    """Terrains with colours, and the texture of one."""
    from rockfall.core.terrain.readers import read_terrain

    files = simulations.coloured()
    textured = {name: files.pop(name) for name in ("t.obj", "t.mtl", "t.png")}
    found = {
        f"colours {name}": Case({name: data}, (name,), lambda at, name=name: _finite(read_terrain(at / name)))
        for name, data in files.items()
    }
    return found | {"texture": Case(textured, tuple(textured), lambda at: _finite(read_terrain(at / "t.obj")))}


def _simulations(terrain: bytes) -> dict[str, Case]:
    """What simulations read: by the readers, and by the commands."""
    files = {"terrain.ply": terrain, **simulations.files()}
    found = {name: Case(files, damaged, read) for name, (damaged, read) in simulations.readers().items()}
    return found | {
        f"rockfall {name}": Case(files, damaged, _ran(*words), command=True, slow=True)
        for name, (damaged, words) in simulations.COMMANDS.items()
    }


def _shown(terrain: bytes, folder: Path) -> dict[str, Case]:
    """What films, pages and animations read."""
    files = {"terrain.ply": terrain, **shown.files(folder)}
    found = {
        name: Case(files, damaged, read, slow=name in shown.SLOW) for name, (damaged, read) in shown.readers().items()
    }
    return found | {
        f"rockfall {name}": Case(files, damaged, _ran(*words), command=True, slow=True)
        for name, (damaged, words) in shown.COMMANDS.items()
    }


def _tables() -> dict[str, Case]:
    from rockfall.core.analysis.truth import read_truth
    from rockfall.core.exchange import block_sizes, cameras, footage_tables, map_shapes, parameters, spin_tables, tables
    from rockfall.core.workflow.alignment import AlignmentOptions, align

    pairs, moving = (FOOTAGE / "pairs.csv").read_bytes(), head_of(FOOTAGE / "camera.toml", 9000, b"[[frame]]")
    sizes = b"d1_m,d2_m,d3_m,density_kgpm3\n0.5,0.4,0.3,2600\n0.4,0.4,0.4,\n"
    every: dict[str, tuple[str, bytes, Callable[[Path], object]]] = {
        "picks": ("picks.csv", examples.PICKS, tables.read_picks),
        "impacts": ("impacts.csv", examples.IMPACTS, tables.read_impacts),
        "pairs": ("pairs.csv", pairs, cameras.read_pairs),
        "align": ("pairs.csv", pairs, lambda at: align(cameras.read_pairs(at), AlignmentOptions((1280, 720)))),
        "camera": ("camera.toml", (CAMERAS / "camera_1.toml").read_bytes(), cameras.read_camera),
        "moving camera": ("camera.toml", moving, cameras.read_camera),
        "track": ("track.csv", head_of(FOOTAGE / "track.csv", 4000), footage_tables.read_track),
        "events": ("events.csv", (FOOTAGE / "events.csv").read_bytes(), footage_tables.read_events),
        "spin marks": ("spin_marks.csv", examples.SPIN_MARKS, spin_tables.read_spin_marks),
        "clicks": ("clicks.csv", (FOOTAGE / "clicks.csv").read_bytes(), footage_tables.read_clicks),
        "sizes": ("sizes.csv", sizes, block_sizes.read_sizes),
        "parameters": ("p.toml", examples.PARAMETERS, parameters.read_parameters),
        "polygon table": ("polygon.csv", examples.POLYGON, lambda at: map_shapes.read_polygons(at, SHIFT)),
        "polygon": ("polygon.geojson", examples.GEOJSON, lambda at: map_shapes.read_polygons(at, SHIFT)),
        "truth": ("truth.csv", head_of(examples.TRUTH, 4000), read_truth),
    }
    return {
        name: Case({file: data}, (file,), lambda at, file=file, reader=reader: reader(at / file))
        for name, (file, data, reader) in every.items()
    }


def _videos() -> dict[str, Case]:
    from rockfall.core.footage.video import open_video

    kinds = (".mp4", ".mkv", ".avi", ".webm", ".mov", ".ts")
    good = [path for path in sorted((DATA / "videos").iterdir()) if path.suffix in kinds]
    return {
        f"video {path.name}": Case(
            {path.name: path.read_bytes()}, (path.name,), lambda at, name=path.name: open_video(at / name), slow=True
        )
        for path in good
    }


def _projects(terrain: bytes) -> dict[str, Case]:
    from rockfall.core.exchange.project import read_project
    from rockfall.core.workflow.opening import open_terrain, read_project_picks

    def opened(at: Path) -> object:
        project = read_project(at / "project.toml")
        return read_project_picks(project, open_terrain(project))[0]

    files = {"project.toml": examples.PROJECT, "terrain.ply": terrain, "picks.csv": examples.PICKS}
    return {"project": Case(files, ("project.toml",), opened), "project's picks": Case(files, ("picks.csv",), opened)}


def _commands(terrain: bytes) -> dict[str, Case]:
    slope, two = {"terrain.ply": terrain}, examples.two_cameras()
    picks, impacts = {"picks.csv": examples.PICKS}, {"impacts.csv": examples.IMPACTS}
    pairs, parameters = {"pairs.csv": (FOOTAGE / "pairs.csv").read_bytes()}, {"p.toml": examples.PARAMETERS}
    camera = {name: two[name] for name in ("pairs_1.csv", "camera_1.toml")}
    falls = {**slope, **parameters, "releases.csv": examples.RELEASES, "zones.geojson": examples.GEOJSON}
    project = {"project.toml": examples.PROJECT, **slope, **picks}
    model, onto = ("--model", "noel_2017"), ("--terrain", "@terrain.ply")
    zones = ("--zones", "@zones.geojson", "--parameters", "@p.toml")
    quick = {
        "terrain": (slope, ("terrain", "@terrain.ply", "--no-picture")),
        "reconstruct": ({**slope, **picks}, ("reconstruct", "@picks.csv", *onto, "--drag")),
        "align": (pairs, ("align", "@pairs.csv", "--size", "1280x720")),
        "align from a camera": (
            camera, ("align", "@pairs_1.csv", "--size", "1280x720", "--camera", "@camera_1.toml")
        ),
        "statistics": (impacts, ("statistics", "@impacts.csv", "--tables-only")),
        "compare": (
            {**impacts, **parameters},
            ("compare", "@impacts.csv", "--tables-only", "--parameters", "@p.toml", *model),
        ),
        "merge": (impacts, ("merge", "@impacts.csv")),
    }  # fmt: skip
    slow = {
        "refine": (two, ("refine", "@project.toml")),
        "motion": (two, ("motion", "@project.toml", "--tables-only")),
        "calibrate": (impacts, ("calibrate", "@impacts.csv", *model, "--fit", "rt", "--resamples", "20")),
        "simulate": (falls, ("simulate", "@releases.csv", *onto, *zones, *model, "--drag")),
        "simulate among trees": (
            {**slope, "releases.csv": examples.RELEASES, "trees.csv": examples.TREES},
            ("simulate", "@releases.csv", *onto, "--trees", "@trees.csv", *model),
        ),
        "simulate a project": (project, ("simulate", "@project.toml")),
    }
    return {
        f"rockfall {name}": Case(files, tuple(files), _ran(*words), command=True, slow=name in slow)
        for name, (files, words) in {**quick, **slow}.items()
    }
