# SPDX-License-Identifier: GPL-3.0-or-later
"""Point clouds in LAS and LAZ."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading import check_promise, reading
from ..vectors import Array
from .crs import CoordinateSystem, geokeys, system_beside, system_from_geokeys, system_from_wkt
from .scan_colours import Colours, colours_of
from .source import Source

DAMAGED = "It is truncated or damaged: copy or export it again"
WITHHELD, SYNTHETIC = np.uint8(1), np.uint8(2)
"""Marks of a point, ASPRS LAS 1.4 R15, tables 8 and 16; what they are kept as here."""
GROUND_CLASS = 2
"""ASPRS LAS 1.4 R15, table 17."""
LOOKED_AT = 500_000
"""So many points are looked at before a cloud is read."""
LAS_HEADER_BYTES, RECORD_HEADER_BYTES, EXTENDED_HEADER_BYTES = 227, 54, 60
"""ASPRS LAS 1.4 R15, tables 3, 6 and 7."""
COMPRESSED, NOT_KNOWN_YET = 0xC0, 2**64 - 1
"""Bits of the point format, and the place of the table of parts when it was written to a stream: LAZ specification."""


def read_las(path: Path, ground_only: bool | None) -> Source:
    """Read a LAS or LAZ cloud, its ground class (2) when it has one and ``ground_only`` is not False.

    Points marked as withheld (to be taken for deleted) or synthetic (not measured), and those classified as noise (7
    and 18), are left out. Key points and points where flight strips overlap are measured points as any others.

    Raises
    ------
    InputError : not a LAS file, truncated, fewer points than its header promises; no ground class when it is asked for.
    """
    header, system = _las_header(path)
    points, classes, flags, colours = _las_points(path, header)
    if len(points) != header.point_count:
        raise _truncated(path, header.point_count, len(points))
    notes = [f"Cloud of {len(points):,} points.", *_copc_sentences(header, path)]
    valid = flags == 0
    if not valid.all():
        notes.append(f"Left out {_flagged(flags)}.")
        if not valid.any():
            raise InputError(
                f"All {len(points):,} points are marked as withheld or synthetic",
                file=path,
                advice="Export the cloud with the points that count",
            )
    ground = valid & (classes == GROUND_CLASS)
    kept = valid
    if ground_only and not ground.any():
        raise InputError(
            f"None of the {int(valid.sum())} points is classified as ground (class {GROUND_CLASS})",
            file=path,
            advice="Use all points, or classify the cloud first",
        )
    if ground.any() and ground_only is not False:
        kept = ground
        notes.append(f"Used the {int(ground.sum()):,} points of the ground class ({GROUND_CLASS}).")
    else:
        noise = valid & ((classes == 7) | (classes == 18))
        if noise.any():
            kept = valid & ~noise
            notes.append(f"Left out {int(noise.sum()):,} points classified as noise (7, 18).")
        notes.append(
            "Used all classes, as asked."
            if ground.any()
            else "The cloud has no ground class: vegetation and buildings, if any, are part of the surface. "
            "The ground filter leaves them out (--ground-filter; in Blender “Points” in the import dialog)."
        )
    if not kept.all():
        points, colours = points[kept], None if colours is None else colours[kept]
    return Source(points, system=system, notes=tuple(notes), colours=colours, step=np.array(header.scales))


def _flagged(flags: NDArray[np.uint8]) -> str:
    """How many points are marked as what."""
    withheld, synthetic = int((flags & WITHHELD > 0).sum()), int((flags == SYNTHETIC).sum())
    parts = [
        *([f"{withheld:,} points marked as withheld"] if withheld else []),
        *([f"{synthetic:,} marked as synthetic (not measured)"] if synthetic else []),
    ]
    return " and ".join(parts)


def inspect_las(path: Path) -> tuple[Array, int, Array, CoordinateSystem, tuple[str, ...]]:
    """Box (2, 3), number of points, scales (3,) and coordinate system, from the header alone; and sentences on the
    points and, from the first ones, on their classes.
    """
    header, system = _las_header(path)
    count = int(header.point_count)
    said = (f"Cloud of {count:,} points.", _ground_sentence(path, count))
    return np.array([header.mins, header.maxs]), count, np.array(header.scales), system, said


def _ground_sentence(path: Path, count: int) -> str:
    """How much of a cloud is classified as ground, and what that means for what is read of it."""
    import laspy

    with reading(path, "cloud", DAMAGED), laspy.open(path) as opened:
        looked_at = opened.read_points(LOOKED_AT)
        some, flags = np.asarray(looked_at.classification), _flags(looked_at)
    said = ""
    if flags.any():
        of_first = "" if count <= LOOKED_AT else f", of the first {LOOKED_AT:,}"
        said = f" Left out: {_flagged(flags)}{of_first}."
    return _class_sentence(some[flags == 0], count) + said


def _class_sentence(some: NDArray[np.uint8], count: int) -> str:
    ground = int((some == GROUND_CLASS).sum())
    if not ground:
        known = "No point" if count <= LOOKED_AT else f"None of the first {LOOKED_AT:,} points"
        said = "vegetation, if there is any, becomes part of the surface; the ground filter takes it out."
        return f"{known} is classified as ground: {said}"
    share = f"{100 * ground / len(some):.0f} %"
    of = f"{ground:,} of them ({share})" if count <= LOOKED_AT else f"Of the first {LOOKED_AT:,}, {share}"
    return f"{of} are classified as ground; only these are used unless others are asked for."


def _las_header(path: Path) -> tuple[Any, CoordinateSystem]:
    import laspy

    size = path.stat().st_size
    if not size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    with path.open("rb") as file:
        if file.read(4) != b"LASF":
            raise InputError('Not a LAS file: it does not begin with "LASF"', file=path, advice="Check its extension")
    _check_promises(path, size)
    with reading(path, "cloud", DAMAGED), laspy.open(path) as opened:
        header = opened.header
        if header.are_points_compressed:
            _check_items(header, path)
    needed = header.offset_to_point_data + header.point_count * header.point_format.size
    compressed = header.are_points_compressed
    if compressed:
        check_promise(f"{header.point_count} points", header.point_count * header.point_format.size, size, path, True)
    if compressed and header.point_count:
        # The first eight bytes of the points say where their table of chunks is: behind the end in a truncated file.
        with path.open("rb") as file:
            file.seek(header.offset_to_point_data)
            needed = int.from_bytes(file.read(8).ljust(8, b"\0"), "little", signed=True)
    if needed > size:
        held = (size - header.offset_to_point_data) // header.point_format.size
        raise _truncated(path, header.point_count, None if compressed else max(held, 0))
    if not header.point_count:
        raise InputError("The cloud has no points", file=path, advice="Export it again")
    return header, _las_system(header, path)


def _check_items(header: Any, path: Path) -> None:
    """What the record of LASzip says of a point: the decoder divides by its size, and prints lines of its own."""
    record = header.vlrs.get("LasZipVlr")[0].record_data
    items = int.from_bytes(record[32:34], "little")
    sizes = np.frombuffer(record, "<u2", 3 * items, 34)[1::3]
    if int(sizes.sum()) != header.point_format.size:
        raise InputError(
            f"The file is damaged: it packs points of {sizes.sum()} bytes, and they have {header.point_format.size}",
            file=path,
            advice="Copy or export it again",
        )


def _check_promises(path: Path, size: int) -> None:
    """What the header counts is within the file, before libraries take memory for it: the decoder of LAZ ends the
    whole process when it gets none."""

    def number(at: int, length: int) -> int:
        file.seek(at)
        return int.from_bytes(file.read(length), "little")

    with path.open("rb") as file:
        if size < LAS_HEADER_BYTES:
            raise InputError("The file is truncated within its header", file=path, advice="Copy or export it again")
        records = number(100, 4)
        check_promise(f"{records} records", records * RECORD_HEADER_BYTES, size, path)
        if number(25, 1) >= 4:  # extended records come with version 1.4
            extended = number(243, 4)
            check_promise(f"{extended} extended records", extended * EXTENDED_HEADER_BYTES, size, path)
        if number(104, 1) & COMPRESSED:
            table = number(number(96, 4), 8)
            table = number(size - 8, 8) if table == NOT_KNOWN_YET else table
            chunks = number(table + 4, 4) if table < size else 0
            check_promise(f"{chunks} parts", chunks, size, path)


def _las_system(header: Any, path: Path) -> CoordinateSystem:
    """Of the record with well-known text, else of that with GeoTIFF keys, else of the ``.prj`` beside the file."""
    records = [*header.vlrs, *(header.evlrs or [])]
    for record in records:
        if text := getattr(record, "string", ""):
            return system_from_wkt(text)
    doubles = [float(one.value) for record in records for one in getattr(record, "doubles", ())]
    texts = [text for record in records for text in getattr(record, "strings", ())]
    for record in records:
        if keys := getattr(record, "geo_keys", None):
            entries = [(key.id, key.tiff_tag_location, key.count, key.value_offset) for key in keys]
            return system_from_geokeys(geokeys(entries, doubles, "\0".join(texts)))
    return system_beside(path)


def _flags(points: Any) -> NDArray[np.uint8]:
    return WITHHELD * np.asarray(points.withheld, np.uint8) | SYNTHETIC * np.asarray(points.synthetic, np.uint8)


def _las_points(path: Path, header: Any) -> tuple[Array, NDArray[np.uint8], NDArray[np.uint8], Colours | None]:
    """Coordinates, classes, `WITHHELD` and `SYNTHETIC`, colours."""
    import laspy

    points = np.empty((header.point_count, 3))
    classes, flags = np.empty(header.point_count, np.uint8), np.empty(header.point_count, np.uint8)
    coloured = {"red", "green", "blue"} <= set(header.point_format.dimension_names)
    colours = np.empty((header.point_count if coloured else 0, 3), np.uint16)
    at = 0
    with reading(path, "cloud", DAMAGED), laspy.open(path) as opened:
        for chunk in opened.chunk_iterator(2_000_000):
            part = slice(at, at + len(chunk))
            for axis, name in enumerate("XYZ"):
                points[part, axis] = np.asarray(chunk[name]) * header.scales[axis] + header.offsets[axis]
            classes[part], flags[part] = np.asarray(chunk.classification), _flags(chunk)
            if coloured:
                for channel, name in enumerate(("red", "green", "blue")):
                    colours[part, channel] = np.asarray(chunk[name])
            at += len(chunk)
    return points[:at], classes[:at], flags[:at], colours_of(colours[:at])[0]


def _copc_sentences(header: Any, path: Path) -> tuple[str, ...]:
    """What to say of a cloud-optimised file (COPC 1.0): its parts of all resolutions together are the cloud."""
    from ..formats.copc import counted_points

    record = next((r for r in header.vlrs if r.user_id == "copc" and r.record_id == 1), None)
    if record is None:
        return ()
    counted = counted_points(path, record.hierarchy_root_offset, record.hierarchy_root_size)
    if counted == header.point_count:
        return ("A cloud-optimised file (COPC): all points of all its levels were read.",)
    return (
        f"A cloud-optimised file (COPC), whose levels count {counted:,} points: all {header.point_count:,} were read.",
    )


def _truncated(path: Path, promised: int, held: int | None) -> InputError:
    found = "the file ends before they do" if held is None else f"it holds {held}"
    return InputError(
        f"The file is truncated: its header promises {promised} points, {found}",
        file=path,
        advice="Copy or export it again",
    )
