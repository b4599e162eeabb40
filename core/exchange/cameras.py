# SPDX-License-Identifier: GPL-3.0-or-later
"""camera.toml and the pairs it is solved from. Positions in files are survey coordinates."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..camera.model import Camera
from ..camera.pairs import Pairs
from ..camera.path import CameraPath
from ..camera.quality import PARAMETERS, CameraQuality, to_plain, whole_covariance
from ..georeference import GlobalShift
from ..least_squares import scales
from ..output import write_text
from ..reading import reader
from ..vectors import Array, Mask
from .csv_text import read_table
from .tables import POSITION, Columns, vector_columns, write_columns
from .toml_text import TomlTable, read_toml

LENS = ("k1", "k2", "k3", "p1", "p2")
SAME_ROTATION = 1e-6
"""Rows this close to unit length and right angles are taken as they are: rounding."""
NEAR_ROTATION = 1e-3
"""Rows this close are a rotation that was written with few decimals: the nearest rotation is taken."""

PAIRS_REQUIRED = ("u_px", "v_px", *POSITION)
PAIRS_KNOWN = (*PAIRS_REQUIRED, "name", "pair", "frame", "sigma_px", "sigma_m", "used")
NO = ("0", "no", "false")
YES = ("", "1", "yes", "true")


@dataclass(frozen=True, eq=False)
class CameraFile:
    """What camera.toml holds.

    Attributes
    ----------
    path : of the camera, with a pose for each frame if it moves.
    rmse_px : of the pairs it was solved from; None when unknown.
    sigma : standard deviations by name: those of `INTRINSICS` in their units, x, y, z [m], omega, phi, kappa [rad].
    crs : coordinate reference system of the position, empty when unknown.
    pose_covariance : (6, 6) of rotation [rad] and position [m], of the whole path, for the lens as it is: what moves
        the path and holds the lens needs; None when unknown.
    pose_covariance_with_lens : (6, 6) the same with what is not known of the lens in it: how well the pose is known;
        None where it is the same or unknown.
    quality : what the camera was solved from; None when unknown.
    extra : keys that this version does not know.
    """

    path: CameraPath
    rmse_px: float | None = None
    sigma: Mapping[str, float] = field(default_factory=dict)
    crs: str = ""
    pose_covariance: Array | None = None
    pose_covariance_with_lens: Array | None = None
    quality: CameraQuality | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)


@reader("camera")
def read_camera(path: str | Path, shift: GlobalShift | None = None) -> CameraFile:
    """Read camera.toml.

    Parameters
    ----------
    shift : of the local frame (the terrain's); None takes the shift proposed for the camera's position.

    Raises
    ------
    InputError : a key that is missing or wrong, a rotation that is none, frames that do not ascend.
    """
    path = Path(path)
    top = TomlTable(read_toml(path, "camera"), "", path)
    crs = top.text("crs", "")
    survey = top.numbers("position", (3,))
    shift = shift if shift is not None else GlobalShift.proposed(survey, survey, crs)
    numbers = {name: top.number(name) for name in ("fx", "fy")}
    numbers |= {name: top.signed(name) for name in ("cx", "cy")} | {name: top.signed(name, 0.0) for name in LENS}
    camera = Camera(
        width=top.whole("width"),
        height=top.whole("height"),
        position=shift.to_local(survey),
        rotation=_rotation(top),
        shift=shift,
        **numbers,
    )
    rmse = top.optional_number("rmse_px", zero_allowed=True)
    sigma = top.table("sigma")
    covariance, with_lens = (_covariance(top, key) for key in ("pose_covariance", "pose_covariance_with_lens"))
    return CameraFile(
        path=_path(top, camera),
        rmse_px=rmse,
        sigma={name: sigma.number(name, 0.0, zero_allowed=True) for name in sigma.rest()},
        crs=crs,
        pose_covariance=covariance,
        pose_covariance_with_lens=with_lens,
        quality=_quality(top),
        extra=top.rest(),
    )


def write_camera(
    file: str | Path,
    path: CameraPath,
    *,
    rmse_px: float | None = None,
    sigma: Mapping[str, float] | None = None,
    crs: str = "",
    pose_covariance: Array | None = None,
    pose_covariance_with_lens: Array | None = None,
    quality: CameraQuality | None = None,
    extra: Mapping[str, Any] | None = None,
) -> None:
    """Write camera.toml, each number so that it reads back as the same double; see `CameraFile`."""
    import tomli_w

    one, more = path.reference, dict(extra or {})
    to_survey = one.shift.to_survey
    tables = {key: value for key, value in more.items() if _is_table(value)}
    lines = [f"width = {one.width}", f"height = {one.height}"]
    lines += [_numbers(name, getattr(one, name)) for name in ("fx", "fy", "cx", "cy", *LENS)]
    lines += [_numbers("position", to_survey(one.position)), _numbers("rotation", one.rotation)]
    if rmse_px is not None and np.isfinite(rmse_px):
        lines.append(_numbers("rmse_px", rmse_px))
    lines += tomli_w.dumps(
        ({"crs": crs or one.shift.crs} if crs or one.shift.crs else {})
        | {key: value for key, value in more.items() if key not in tables}
    ).splitlines()
    named = {"pose_covariance": pose_covariance, "pose_covariance_with_lens": pose_covariance_with_lens}
    lines += [_numbers(key, value) for key, value in named.items() if value is not None and np.isfinite(value).all()]
    if known := {name: value for name, value in (sigma or {}).items() if np.isfinite(value)}:
        lines += ["", "[sigma]", *(_numbers(name, value) for name, value in known.items())]
    if quality is not None:
        lines += ["", *tomli_w.dumps({"quality": to_plain(quality)}).splitlines()]
    if tables:
        lines += ["", *tomli_w.dumps(tables).splitlines()]
    for i, position in enumerate([] if path.is_fixed else to_survey(path.position)):
        lines += ["", "[[frame]]", _numbers("time_s", path.time_s[i]), _numbers("position", position)]
        lines.append(_numbers("rotation", path.rotation[i]))
        deviations = {"sigma_position_m": path.sigma_position_m[i], "sigma_rotation_rad": path.sigma_rotation[i]}
        lines += [_numbers(name, value) for name, value in deviations.items() if value]
    write_text(file, "\n".join(lines) + "\n")


@reader("table of pairs")
def read_pairs(path: str | Path, shift: GlobalShift | None = None) -> Pairs:
    """Read pairs.csv: pixels and the terrain points seen there.

    Parameters
    ----------
    shift : of the local frame (the terrain's); None takes the shift proposed for the points.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row.
    """
    table = read_table(path, PAIRS_REQUIRED, PAIRS_KNOWN)
    survey = table.vectors(POSITION, required=True)
    shift = shift if shift is not None else GlobalShift.proposed(survey.min(axis=0), survey.max(axis=0))
    frame = table.numbers("frame")
    for i in np.flatnonzero(~np.isnan(frame) & ((frame < 0) | (frame % 1 != 0))):
        raise table.error(int(i), f"The frame {frame[i]:g} is no whole number of zero or more", "Frames count from 0")
    sigmas = {name: table.numbers(name) for name in ("sigma_px", "sigma_m")}
    for name, sigma in sigmas.items():
        for i in np.flatnonzero(sigma < 0):
            raise table.error(int(i), f"{name} is below zero", "Give a number of zero or more, or nothing")
    used = [cell.lower() for cell in table.text("used")]
    for i, cell in enumerate(used):
        if cell not in (*YES, *NO):
            raise table.error(i, f"'{cell}' in column used is neither 1 nor 0", "Write 0 to leave the pair out")
    names = table.text("name") if "name" in table.columns else table.text("pair")
    return Pairs(
        pixel=table.vectors(("u_px", "v_px"), required=True),
        point=shift.to_local(survey),
        name=np.array([name or str(number) for number, name in enumerate(names, 1)], dtype=np.str_),
        frame=np.where(np.isnan(frame), -1, frame).astype(np.intp),
        used=np.array([cell not in NO for cell in used], dtype=np.bool_),
        row=np.asarray(table.row, dtype=np.intp),
        source=Path(path),
        shift=shift,
        **sigmas,
    )


def write_pair_residuals(path: str | Path, pairs: Pairs, residual_px: Array, residual_m: Array, used: Mask) -> None:
    """Write pairs_residuals.csv: the pairs in their order, each with what is left of it.

    Parameters
    ----------
    residual_px : (n, 2) marked minus projected [px]; NaN where the camera does not see the point.
    residual_m : (n,) how far that is at the point [m].
    used : (n,) whether the pair counted in the solution.
    """
    columns: Columns = {"pair": [str(number) for number in range(1, len(pairs) + 1)]}
    columns |= vector_columns(("u_px", "v_px"), pairs.pixel)
    columns |= vector_columns(("residual_u_px", "residual_v_px"), residual_px)
    columns |= {"residual_m": residual_m, "used": ["1" if one else "0" for one in used.tolist()], "name": pairs.name}
    if (pairs.frame >= 0).any():
        columns["frame"] = [str(frame) if frame >= 0 else "" for frame in pairs.frame.tolist()]
    write_columns(path, columns)


def _numbers(key: str, values: ArrayLike) -> str:
    """A number or an array as TOML, each so that it reads back as the same double; a matrix has a row on each line."""
    array = np.asarray(values, dtype=np.float64)
    text = repr(array.tolist())
    return f"{key} = " + (text.replace("[[", "[\n  [").replace("], ", "],\n  ").replace("]]", "],\n]"))


def _is_table(value: Any) -> bool:
    """A section, or a list of sections, which TOML has after all other keys."""
    return isinstance(value, Mapping) or (isinstance(value, list) and any(isinstance(one, Mapping) for one in value))


def _path(top: TomlTable, camera: Camera) -> CameraPath:
    """The poses of the frames; the camera's own where there are none."""
    frames = top.tables("frame")
    times = np.array([frame.signed("time_s") for frame in frames])
    for i in np.flatnonzero(np.diff(times) <= 0):
        problem = f"is {times[i + 1]:g} s, after {times[i]:g} s"
        raise frames[i + 1].wrong("time_s", problem, "Put the frames in the order of their times, each time once")
    if not frames:
        return CameraPath(camera, np.zeros(1), camera.position[None], camera.rotation[None], np.zeros(1), np.zeros(1))
    return CameraPath(
        camera,
        times,
        camera.shift.to_local(np.stack([frame.numbers("position", (3,)) for frame in frames])),
        np.stack([_rotation(frame) for frame in frames]),
        np.array([frame.deviation("sigma_position_m") for frame in frames]),
        np.array([frame.deviation("sigma_rotation_rad") for frame in frames]),
    )


def _rotation(table: TomlTable) -> Array:
    """(3, 3) from the world to the camera; the nearest rotation to one that was rounded."""
    rows = table.numbers("rotation", (3, 3))
    off = float(np.abs(rows @ rows.T - np.eye(3)).max())
    if off > NEAR_ROTATION:
        raise table.wrong(
            "rotation",
            f"is no rotation: its rows are off unit length and right angles by {off:.2g}",
            "Give three rows of unit length, at right angles: the camera's right, down and forward in the world",
        )
    if np.linalg.det(rows) < 0:
        raise table.wrong(
            "rotation",
            "mirrors: it is left-handed",
            "Its rows are the camera's right, down and forward; change the sign of one row",
        )
    if off > SAME_ROTATION:
        left, _, right = np.linalg.svd(rows)
        rows = left @ right
    return rows


def _quality(top: TomlTable) -> CameraQuality | None:
    """What the camera rests on; None in files of earlier versions and of other programs."""
    if not top.has("quality"):
        return None
    table = top.table("quality")
    sigma = table.take("sigma_position_m")
    if sigma is not None and not (isinstance(sigma, (int, float)) and sigma > 0):
        raise table.wrong("sigma_position_m", f"is {sigma!r}, no standard deviation", "Give metres, or leave it out")
    return CameraQuality(
        pairs=table.whole("pairs", zero_allowed=True),
        redundancy=table.whole("redundancy", zero_allowed=True),
        left_out=table.texts("left_out", "P4"),
        asked=table.texts("asked", "P4"),
        sigma_position_m=float("nan") if sigma is None else float(sigma),
        covariance=_whole_covariance(table),
    )


def _whole_covariance(table: TomlTable) -> Array | None:
    names = table.texts("covariance_of", "fx")
    if not names:
        return None
    matrix = table.numbers("covariance", (len(names), len(names)))
    if not set(names) <= set(PARAMETERS):
        raise table.wrong("covariance_of", f"is {list(names)}", f"Choose from {', '.join(PARAMETERS)}")
    if not _is_covariance(matrix):
        raise table.wrong("covariance", "is not symmetric and positive", "Remove it, or solve the camera again")
    return whole_covariance(names, matrix)


def _covariance(top: TomlTable, key: str) -> Array | None:
    if not top.has(key):
        return None
    matrix = top.numbers(key, (6, 6))
    if not _is_covariance(matrix):
        raise top.wrong(key, "is not symmetric and positive", "Remove it, or solve the camera again")
    return matrix


def _is_covariance(matrix: Array) -> bool:
    if not np.allclose(matrix, matrix.T, rtol=1e-6, atol=1e-12 * np.abs(np.diag(matrix)).max()):
        return False
    size = scales(np.abs(matrix))
    return bool(np.linalg.eigvalsh(matrix / np.outer(size, size)).min() > -1e-9)
