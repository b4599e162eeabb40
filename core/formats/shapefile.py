# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and polygons of ESRI shapefiles, with what stands beside them, or all in a zip archive.

Source: ESRI Shapefile Technical Description (1998). Which rings are holes follows from what is within what, since not
all programs keep the order in which the corners of an outline must go.
"""

import codecs
import io
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import InputError
from ..vectors import Array
from .archives import names_in, unpacked
from .features import MOST_POINTS, Feature, Features, Kind

SUFFIXES = (".shp",)
BESIDE = (".dbf", ".shx", ".prj", ".cpg")
NO_HEIGHT = -1e38
"""Below this a height says that there is none."""
TYPES: Mapping[int, tuple[str, Kind | None]] = {
    0: ("NULL", None), 1: ("POINT", None), 3: ("POLYLINE", "line"), 5: ("POLYGON", "polygon"), 8: ("MULTIPOINT", None),
    11: ("POINTZ", None), 13: ("POLYLINEZ", "line"), 15: ("POLYGONZ", "polygon"), 18: ("MULTIPOINTZ", None),
    21: ("POINTM", None), 23: ("POLYLINEM", "line"), 25: ("POLYGONM", "polygon"), 28: ("MULTIPOINTM", None),
    31: ("MULTIPATCH", None),
}  # fmt: skip
LANGUAGES = {0x01: "cp437", 0x02: "cp850", 0x03: "cp1252", 0x57: "cp1252", 0x64: "cp852", 0x65: "cp866", 0xC8: "cp1250"}
"""Of the header of the table of attributes: the code page of its texts, where no .cpg names it."""
MOST_RINGS = 20_000
ADVICE = "Export it again, or as GeoJSON"


def read_shapefile(path: Path) -> Features:
    """Read a shapefile, or the only one in a zip archive.

    Raises
    ------
    InputError : no shapefile, a damaged one, none or several in the archive, a feature without a geometry, an encoding
        that is not known.
    """
    files = _zipped(path) if path.suffix.lower() == ".zip" else _beside(path)
    encoding = _encoding(files.get(".cpg", b""), files.get(".dbf", b""), path)
    try:
        found = tuple(_features(files, encoding, path))
    except UnicodeDecodeError as error:
        raise InputError(
            f"Its texts are not in {encoding}", file=path, advice="Correct the .cpg beside it, or export it in UTF-8"
        ) from error
    wkt = files.get(".prj", b"").decode("utf-8", "replace").strip("\0 \n\r\t\ufeff")
    return Features(found, "", wkt)


def parts_beside(path: Path) -> dict[str, Path]:
    """Ending → file of what belongs to a shapefile and stands beside it; nothing for another file."""
    if path.suffix.lower() not in SUFFIXES:
        return {}
    found = {}
    for suffix in BESIDE:
        for name in (path.with_suffix(suffix), path.with_suffix(suffix.upper())):
            if suffix not in found and name.is_file():
                found[suffix] = name
    return found


def _beside(path: Path) -> dict[str, bytes]:
    """Ending → content of the parts of a shapefile."""
    return {".shp": path.read_bytes(), **{suffix: file.read_bytes() for suffix, file in parts_beside(path).items()}}


def _zipped(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        shapes = names_in(archive, ".shp", path)
        if len(shapes) != 1:
            named = ", ".join(PurePosixPath(name).name for name in shapes)
            raise InputError(
                f"The archive has {'several shapefiles: ' + named if shapes else 'no shapefile'}",
                file=path,
                advice="Give an archive with one .shp and what belongs to it, or the file itself",
            )
        stem = shapes[0][: -len(".shp")]
        files = {".shp": unpacked(archive, shapes[0], path)}
        for name in archive.namelist():
            suffix = PurePosixPath(name).suffix.lower()
            if suffix in BESIDE and name[: -len(suffix)] == stem:
                files[suffix] = unpacked(archive, name, path)
    return files


def _encoding(cpg: bytes, dbf: bytes, path: Path) -> str:
    """Of the texts: as the .cpg says, else the table's header, else UTF-8 if they are that, else Western."""
    name = cpg.decode("ascii", "replace").strip("\0 \n\r\t\ufeff")
    if name:
        for one in (name, f"cp{name.upper().removeprefix('ANSI').strip()}", name.replace(" ", "_")):
            try:
                return codecs.lookup(one).name
            except (LookupError, ValueError):
                continue
        raise InputError(
            f"The encoding {name[:40]!r} of the .cpg is not known", file=path, advice="Export the shapefile in UTF-8"
        )
    if len(dbf) > 29 and dbf[29] in LANGUAGES:
        return LANGUAGES[dbf[29]]
    try:
        dbf[32:].decode("utf-8")
        return "utf-8"
    except UnicodeDecodeError:
        return "cp1252"


def _features(files: Mapping[str, bytes], encoding: str, path: Path) -> Iterator[Feature]:
    import shapefile

    main = files[".shp"]
    if len(main) < 100 or int.from_bytes(main[:4], "big") != 9994:
        raise InputError("This is no shapefile", file=path, advice=ADVICE)
    promised = 2 * int.from_bytes(main[24:28], "big", signed=True)
    if promised != len(main):
        raise InputError(
            f"The file is cut short or damaged: its header promises {promised:,} bytes, and it has {len(main):,}",
            file=path,
            advice=ADVICE,
        )
    records = _records(files.get(".dbf"), encoding, path)
    index = files.get(".shx")
    if index is not None and (len(index) < 100 or (len(index) - 100) % 8):
        index = None
    left, number = MOST_POINTS, 0
    with shapefile.Reader(shp=io.BytesIO(main), shx=None if index is None else io.BytesIO(index)) as reader:
        shapes: Iterator[Any] = (
            reader.iterShapes() if index is None else (reader.shape(i) for i in range((len(index) - 100) // 8))
        )
        for number, shape in enumerate(shapes, start=1):
            if records is not None and number > len(records):
                raise InputError(
                    f"It has more shapes than the {len(records)} rows of its .dbf", file=path, advice=ADVICE
                )
            properties = {} if records is None else records[number - 1]
            if properties is None:  # deleted, and not yet packed
                continue
            name, kind = TYPES.get(shape.shapeType, (f"type {shape.shapeType}", None))
            if shape.shapeType == 0 or (kind is not None and not shape.points):
                raise InputError(f"The feature {number} has no geometry", file=path, advice="Delete it, or draw it")
            if kind is None:
                yield Feature("", name, number, (), properties)
                continue
            left -= len(shape.points)
            if left < 0:
                raise InputError(f"It has more than {MOST_POINTS:,} points", file=path, advice="Simplify it")
            parts = _parts(shape, number, path)
            groups = [(part,) for part in parts] if kind == "line" else outlines(parts, number, path)
            for group in groups:
                yield Feature(kind, name, number, group, properties)
    if records is not None and number < len(records):
        raise InputError(f"It has {number} shapes, and {len(records)} rows in its .dbf", file=path, advice=ADVICE)


def _records(dbf: bytes | None, encoding: str, path: Path) -> list[dict[str, object] | None] | None:
    """Attributes by row, None for one that is deleted; None without a table."""
    import shapefile

    if dbf is None:
        return None
    if len(dbf) < 33:
        raise InputError("Its .dbf is cut short", file=path, advice=ADVICE)
    rows, head, width = (int.from_bytes(dbf[a:b], "little") for a, b in ((4, 8), (8, 10), (10, 12)))
    if head + rows * width > len(dbf):
        raise InputError("Its .dbf is cut short", file=path, advice=ADVICE)
    with shapefile.Reader(dbf=io.BytesIO(dbf), encoding=encoding) as reader:
        names = [field[0] for field in reader.fields[1:]]
        found: list[dict[str, object] | None] = []
        for row in range(rows):
            record = reader.record(row)
            if record is None:
                found.append(None)
                continue
            values = dict(zip(names, record, strict=True))
            found.append({key: _value(value) for key, value in values.items() if value not in (None, "", b"")})
    return found


def _value(value: object) -> object:
    return value.isoformat() if isinstance(value, date) else value.strip() if isinstance(value, str) else value


def _parts(shape: Any, number: int, path: Path) -> list[Array]:
    """The lines or rings of a shape, (k, 3); NaN for heights that it has not."""
    points = np.full((len(shape.points), 3), np.nan)
    points[:, :2] = np.array([point[:2] for point in shape.points], dtype=np.float64)
    heights = getattr(shape, "z", None)
    if heights is not None and len(heights) == len(points) and shape.shapeType in (13, 15):
        points[:, 2] = np.array(heights, dtype=np.float64)
        points[points[:, 2] < NO_HEIGHT, 2] = np.nan
    starts = list(shape.parts)
    if not starts or starts[0] != 0 or starts != sorted(set(starts)) or starts[-1] >= len(points):
        raise InputError(f"The parts of the feature {number} are damaged", file=path, advice=ADVICE)
    return np.split(points, starts[1:])


def outlines(rings: Sequence[Array], number: int, path: Path) -> list[tuple[Array, ...]]:
    """Outlines, each with its holes: what is within an odd number of other rings is a hole."""
    if len(rings) == 1:
        return [tuple(rings)]
    if len(rings) > MOST_RINGS:
        raise InputError(f"The feature {number} has {len(rings):,} rings", file=path, advice="Simplify it")
    low = np.array([ring[:, :2].min(axis=0) for ring in rings])
    high = np.array([ring[:, :2].max(axis=0) for ring in rings])
    size = np.array([_area(ring) for ring in rings])
    around: list[list[int]] = []
    for i, ring in enumerate(rings):
        maybe = np.flatnonzero((low <= low[i]).all(axis=1) & (high >= high[i]).all(axis=1) & (size > size[i]))
        around.append([j for j in maybe.tolist() if _mostly_within(ring, rings[j])])
    groups = {i: [rings[i]] for i in range(len(rings)) if len(around[i]) % 2 == 0}
    for i, ones in enumerate(around):
        if len(ones) % 2:
            outer = min((j for j in ones if len(around[j]) == len(ones) - 1), key=lambda j: size[j], default=None)
            if outer is None:
                raise InputError(f"The rings of the feature {number} cross", file=path, advice="Repair it in a GIS")
            groups[outer].append(rings[i])
    return [tuple(group) for group in groups.values()]


def _area(ring: Array) -> float:
    x, y = (ring[:, :2] - ring[0, :2]).T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def _mostly_within(ring: Array, other: Array) -> bool:
    """Whether most of a ring's sides have their middle inside of another; corners may be common to both."""
    middles = (ring[:, :2] + np.roll(ring[:, :2], -1, axis=0)) / 2
    a, b = other[:, :2], np.roll(other[:, :2], -1, axis=0)
    step = max(1, len(middles) // 16)
    inside = []
    for x, y in middles[::step].tolist():
        crosses = (a[:, 1] > y) != (b[:, 1] > y)
        at = a[crosses, 0] + (y - a[crosses, 1]) / (b[crosses, 1] - a[crosses, 1]) * (b[crosses, 0] - a[crosses, 0])
        inside.append(int((at > x).sum()) % 2 == 1)
    return 2 * sum(inside) > len(inside)
