# SPDX-License-Identifier: GPL-3.0-or-later
"""From the demo's rendered footage to impacts, with no truth given; then against the truth.

Runs ``rockfall align``, ``rockfall track`` and ``rockfall refine`` on assets/demo/footage as a user would, and prints
how far camera, track, times, places (beside their standard deviations, of each axis) and speeds are off. With --ship,
what align and track wrote is put beside the footage, where its project uses it.
"""

import argparse
import csv
import shutil
import sys
from pathlib import Path

import numpy as np
from rockfall.core.camera.model import project
from rockfall.core.cli import main as rockfall
from rockfall.core.exchange.cameras import read_camera
from rockfall.core.exchange.project import read_project
from rockfall.core.georeference import GlobalShift
from rockfall.core.vectors import Array, norm

ROOT = Path(__file__).resolve().parents[2]
FOOTAGE = ROOT / "assets" / "demo" / "footage"
SHIPPED = ("camera.toml", "track.csv", "events.csv")
SAME_IMPACT_S = 0.1
AXES = "xyz"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "footage")
    parser.add_argument("--ship", action="store_true", help="renew the files beside the footage")
    parser.add_argument("--no-run", action="store_true", help="compare what is in the folder already")
    arguments = parser.parse_args()
    if not arguments.no_run and (status := run(arguments.out)):
        return status
    if arguments.ship:
        for name in SHIPPED:
            shutil.copy(arguments.out / name, FOOTAGE / name)
    return report(arguments.out)


def run(out: Path) -> int:
    """The three commands; each may stop the chain."""
    video = str(FOOTAGE / "footage.mp4")
    steps = (
        ["align", str(FOOTAGE / "pairs.csv"), "--video", video, "--frame", "0", "--moving", "rotation"],
        ["track", video, "--clicks", str(FOOTAGE / "clicks.csv")],
        ["refine", str(out / "project.toml")],
    )
    out.mkdir(parents=True, exist_ok=True)
    described = (FOOTAGE / "project.toml").read_text(encoding="utf-8")
    for name in ("../terrain.ply", "footage.mp4"):
        described = described.replace(f'"{name}"', f'"{(FOOTAGE / name).resolve().as_posix()}"')
    (out / "project.toml").write_text(described, encoding="utf-8")
    for step in steps:
        print(f"\nrockfall {' '.join(Path(word).name if '/' in word else word for word in step)}", flush=True)
        if status := rockfall([*step, "--out", str(out / "refined" if step[0] == "refine" else out)]):
            return status
    return 0


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def numbers(rows: list[dict[str, str]], *names: str) -> Array:
    """(n, columns), NaN where a cell is empty."""
    return np.array([[float(row[name] or "nan") for name in names] for row in rows], dtype=np.float64)


def report(out: Path) -> int:
    """Print the errors; 1 when they are larger than the README promises."""
    shift = read_project(FOOTAGE / "project.toml").terrain.global_shift or GlobalShift()
    offset_s = read_project(FOOTAGE / "project.toml").videos[0].offset_s
    block, camera_rows = rows_of(FOOTAGE / "truth" / "block.csv"), rows_of(FOOTAGE / "truth" / "camera.csv")
    place = shift.to_local(numbers(block, "x_m", "y_m", "z_m"))
    pixel, time = numbers(block, "u_px", "v_px"), numbers(block, "time_s")[:, 0]
    path = read_camera(out / "camera.toml", shift).path
    position, rotation = path.poses_at(time)
    true_position = shift.to_local(numbers(camera_rows, "x_m", "y_m", "z_m"))
    track = rows_of(out / "track.csv")
    frames = numbers(track, "frame")[:, 0].astype(int)
    seen = project(path.reference, place[frames], position=position[frames], rotation=rotation[frames]) - pixel[frames]
    marked = numbers(track, "u_px", "v_px") - pixel[frames]
    distance = float(np.median(norm(place[frames] - true_position[frames])))
    away = norm((position - true_position).mean(axis=0))
    visible = int(numbers(block, "visible").sum())
    print("\nAgainst the truth:")
    print(
        f"  camera   {away:.2f} m off at {distance:.0f} m ({100 * away / distance:.2f} %), focal length "
        f"{100 * (path.reference.fx / 2100 - 1):+.2f} %; the block's place in the picture {rms(seen):.2f} px off"
    )
    print(
        f"  track    {len(track)} of {visible} frames in which the block is seen; centre {rms(marked):.2f} px off, "
        f"of which {norm(marked.mean(axis=0)):.2f} px always the same (the sunlit side)"
    )

    true, found = rows_of(FOOTAGE / "truth" / "impacts.csv"), rows_of(out / "refined" / "impacts.csv")
    at, found_at = numbers(true, "time_s")[:, 0] + offset_s, numbers(found, "time_s")[:, 0]
    match = np.argmin(np.abs(found_at[:, None] - at), axis=1)
    late = found_at - at[match]
    contact = numbers([true[i] for i in match], *(f"contact_{axis}_m" for axis in AXES))
    off = norm(numbers(found, "x_m", "y_m", "z_m") - contact)
    picks = rows_of(out / "refined" / "picks.csv")
    nearest = np.argmin(np.abs(numbers(picks, "time_s")[:, 0] - found_at[:, None]), axis=1)
    sigma = numbers(picks, "sigma_position_m")[nearest, 0]
    print("  impact   time       place (σ)      incident speed            restituted speed          contacts")
    errors = []
    for i, row in enumerate(found):
        cells = []
        for part in ("v1", "v2"):
            columns = [f"{part}{axis}_mps" for axis in AXES]
            ours, theirs = norm(numbers([row], *columns))[0], norm(numbers([true[match[i]]], *columns))[0]
            errors.append(abs(ours / theirs - 1))
            cells.append(
                f"{ours:6.2f} of {theirs:5.2f} m/s {100 * (ours / theirs - 1):+5.1f} %" if ours == ours else "–"
            )
        contacts = true[match[i]]["contacts"]
        print(
            f"  {i + 1:>6}   {1e3 * late[i]:+5.1f} ms   {100 * off[i]:4.0f} cm ({100 * sigma[i]:2.0f})   {cells[0]:<26}"
            f"{cells[1]:<26}{contacts}"
        )
    single = np.array([true[i]["contacts"] == "1" for i in match])
    print(
        f"  median   {1e3 * np.median(np.abs(late)):5.1f} ms   {100 * np.median(off):4.0f} cm "
        f"({100 * np.median(sigma):2.0f})   speeds {100 * np.nanmedian(errors):.2f} %; "
        f"where one contact makes the impact, time {1e3 * np.median(np.abs(late[single])):.1f} ms"
    )
    good = (
        len(found) == len(true) - 1
        and (np.abs(late) < SAME_IMPACT_S).all()
        and away < 0.002 * distance
        and np.nanmedian(errors) < 0.01
        and len(track) >= 0.95 * visible
    )
    if not good:
        print("This is worse than the README says.")
    return 0 if good else 1


def rms(difference: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(difference**2, axis=1))))


if __name__ == "__main__":
    sys.exit(main())
