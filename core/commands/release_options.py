# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments of `simulate` about what falls and from where, and about zones of the ground."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..constants import ROCK_DENSITY_KGPM3
from ..errors import InputError
from .options import naming, reading_as_asked, whole

if TYPE_CHECKING:
    from ..simulation.blocks import Blocks
    from ..simulation.ground import Ground
    from ..simulation.release import Releases
    from ..simulation.zones import Zones
    from ..terrain.cloud import Cloud
    from ..terrain.surface import Surface
    from ..workflow.simulation import ReleaseSource

DIAMETER = "0.35"
SOURCES = ("RELEASES", "--from-line", "--from-polygon", "--steeper-than", "--from-impacts")


def add_release_options(parser: argparse.ArgumentParser) -> None:
    """Sources of releases, blocks and zones, beside the table RELEASES."""
    source = parser.add_argument_group("where blocks start, in place of a table of releases")
    source.add_argument(
        "--from-line",
        metavar="FILE",
        help="anywhere along lines: a shapefile, KML, GeoJSON, a GeoPackage, or a table name, x_m, y_m, z_m",
    )
    source.add_argument("--evenly", action="store_true", help="evenly along the lines, not at random")
    source.add_argument(
        "--from-polygon",
        metavar="FILE",
        help="within polygons of a map, as many on each square metre of the terrain itself: a shapefile, KML, GeoJSON, "
        "a GeoPackage, or a table of corners",
    )
    source.add_argument(
        "--steeper-than",
        type=float,
        metavar="DEG",
        help="on all terrain that is steeper, or on that within --from-polygon; as many on each square metre of it",
    )
    source.add_argument(
        "--from-impacts", metavar="FILE", help="just after measured impacts, with their velocity: impacts.csv"
    )
    source.add_argument(
        "--spin",
        choices=("rolling", "zero"),
        help="after impacts where it was not measured: that of rolling (default) or none",
    )
    source.add_argument(
        "--number",
        type=whole,
        metavar="N",
        help="blocks from each release without a number, from each impact; in all from lines, polygons and steep "
        "terrain (default 1)",
    )
    block = parser.add_argument_group("blocks, where the releases do not say")
    block.add_argument(
        "--diameter",
        metavar="D",
        help=f"mean diameter [m]: 0.5, 0.3..0.6, normal:MEAN,SD, lognormal:MEAN,SD; three: 1.2x0.8x0.5; or a table of "
        f"measured sizes (d1_m, d2_m, d3_m or diameter_m; density_kgpm3) to draw from (default {DIAMETER})",
    )
    block.add_argument(
        "--proportions", metavar="A:B:C", help="of the three diameters of a box or an ellipsoid (default equal)"
    )
    block.add_argument(
        "--density",
        metavar="RHO",
        help=f"[kg/m³]: a number, a range or a law as above (default {ROCK_DENSITY_KGPM3:g})",
    )
    block.add_argument(
        "--shape",
        choices=("sphere", "cube", "box", "ellipsoid"),
        help="of the solid, for mass and inertia; all touch the ground as the sphere of the mean diameter (default "
        "sphere, ellipsoid with three diameters)",
    )
    add_zone_options(parser)


def add_zone_options(parser: argparse.ArgumentParser) -> None:
    """Zones of the ground."""
    zones = parser.add_argument_group("zones of the ground with parameters of their own")
    zones.add_argument(
        "--zones",
        metavar="FILE",
        help="polygons with a name and parameters as properties: friction, PARAMETER or MODEL.PARAMETER; a "
        "shapefile, KML, GeoJSON, a GeoPackage, or a table of corners name, x_m, y_m with a column for each parameter",
    )
    zones.add_argument(
        "--zone-attribute",
        metavar="NAME",
        help="an attribute of the vertices or faces of the terrain's PLY file tells the zones; --zones is then a table "
        "value, name with a column for each parameter",
    )


def releases_as_asked(arguments: argparse.Namespace) -> "tuple[ReleaseSource, dict[str, Path]]":
    """What puts the blocks on the ground, and the files that it reads.

    Raises
    ------
    InputError : no source, or several; options that do not go together; blocks that cannot be.
    """
    from ..exchange.simulation_tables import read_releases

    given = sources_given(arguments)
    if not given:
        several = len(arguments.terrain) > 1
        raise InputError(
            "Nothing says where blocks start",
            advice=("Write the table of releases before --terrain" if several else "Give a table of releases")
            + f", or give {', '.join(SOURCES[1:])}",
        )
    if len(given) > 1 and given != ["--from-polygon", "--steeper-than"]:
        raise InputError(f"{' and '.join(given)} both say where blocks start", advice="Give one of them")
    if arguments.evenly and given != ["--from-line"]:
        raise InputError("--evenly goes with --from-line alone", advice="Leave it out")
    if arguments.spin is not None and given != ["--from-impacts"]:
        raise InputError("--spin goes with --from-impacts alone", advice="Leave it out")
    blocks = blocks_as_asked(arguments)
    number = 1 if arguments.number is None else arguments.number
    seed = 0 if arguments.seed is None else arguments.seed
    inputs = {
        name: Path(file)
        for name, file in (
            ("releases", arguments.releases),
            ("line", arguments.from_line),
            ("polygon", arguments.from_polygon),
            ("impacts", arguments.from_impacts),
            ("sizes", arguments.diameter if blocks.measured is not None else None),
        )
        if file is not None
    }

    def release(ground: "Ground") -> "Releases":
        if arguments.releases is not None:
            return read_releases(arguments.releases, ground, blocks, number, seed)
        if arguments.from_line is not None:
            return _from_line(arguments, ground, blocks, number, seed)
        if arguments.from_impacts is not None:
            return _from_impacts(arguments, ground, blocks if blocks_said(arguments) else None, number, seed)
        return _from_area(arguments, ground, blocks, number, seed)

    return release, inputs


def zones_as_asked(
    arguments: argparse.Namespace, terrain: "Surface | Cloud", models: Sequence[str]
) -> "tuple[Zones | None, dict[str, Path]]":
    """The zones of ``--zones``, None without, and the files that they are from.

    Raises
    ------
    InputError : see `open_zones`.
    """
    from ..exchange.zones import open_zones

    if arguments.zones is None:
        if arguments.zone_attribute is not None:
            raise InputError(
                "--zone-attribute says which values, not what they mean",
                advice="Give --zones FILE with a row for each value",
            )
        return None, {}
    zones = open_zones(
        arguments.zones, arguments.zone_attribute or "", terrain, models,
        terrain_files=arguments.terrain, how=reading_as_asked(arguments),
    )  # fmt: skip
    return zones, {"zones": Path(arguments.zones)}


def sources_given(arguments: argparse.Namespace) -> list[str]:
    """Those of `SOURCES` that were given."""
    names = {option: option.strip("-").replace("-", "_").lower() for option in SOURCES}
    return [option for option, name in names.items() if getattr(arguments, name) is not None]


def blocks_said(arguments: argparse.Namespace) -> bool:
    """Whether the options say anything of the blocks."""
    return any(getattr(arguments, name) is not None for name in ("diameter", "density", "shape", "proportions"))


def blocks_as_asked(arguments: argparse.Namespace) -> "Blocks":
    """The law of the blocks.

    Raises
    ------
    InputError : blocks that cannot be.
    """
    from dataclasses import replace

    from ..exchange.block_sizes import parse_blocks

    blocks = parse_blocks(
        arguments.diameter or DIAMETER, arguments.density or f"{ROCK_DENSITY_KGPM3:g}", arguments.shape
    )
    if arguments.proportions is None:
        return blocks
    try:
        a, b, c = (float(part) for part in arguments.proportions.split(":"))
    except ValueError as error:
        raise InputError(
            f"--proportions {arguments.proportions} are not three numbers", advice="Write A:B:C, for example 3:2:1"
        ) from error
    if arguments.shape is None:
        blocks = replace(blocks, shape="ellipsoid")
    return replace(blocks, proportions=(a, b, c))


def _from_line(arguments: argparse.Namespace, ground: "Ground", blocks: "Blocks", number: int, seed: int) -> "Releases":
    from ..exchange.map_shapes import read_lines
    from ..simulation.release_sources import on_line

    lines = read_lines(arguments.from_line, ground.shift)
    with naming(arguments.from_line):
        placed = on_line(
            ground,
            [line.parts[0] for line in lines],
            blocks,
            number,
            seed,
            evenly=arguments.evenly,
            names=[line.name for line in lines],
        )
    return placed.with_remarks(*lines.remarks)


def _from_area(arguments: argparse.Namespace, ground: "Ground", blocks: "Blocks", number: int, seed: int) -> "Releases":
    from math import radians

    from ..exchange.map_shapes import polygon_of, read_polygons
    from ..simulation.release_sources import in_polygon, steeper_than

    angle = None if arguments.steeper_than is None else radians(arguments.steeper_than)
    if arguments.from_polygon is None:
        assert angle is not None
        return steeper_than(ground, angle, blocks, number, seed)
    shapes = read_polygons(arguments.from_polygon, ground.shift)
    polygons = [polygon_of(shape, arguments.from_polygon) for shape in shapes]
    with naming(arguments.from_polygon):
        placed = in_polygon(ground, polygons, blocks, number, seed, steeper_than=angle)
    return placed.with_remarks(*shapes.remarks)


def _from_impacts(
    arguments: argparse.Namespace, ground: "Ground", blocks: "Blocks | None", number: int, seed: int
) -> "Releases":
    from ..exchange.tables import read_impacts
    from ..simulation.measured_releases import from_impacts

    impacts = read_impacts(arguments.from_impacts)
    with naming(arguments.from_impacts):
        return from_impacts(ground, impacts, blocks, number, seed, spin=arguments.spin or "rolling")
