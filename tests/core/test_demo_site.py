# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo site is what it says: geometry, physics, noise; and the reconstruction finds the truth again.

The truth was simulated by code that shares nothing with `rockfall.core`, so this is an independent test of both.
"""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.analysis.statistics import impact_statistics
from rockfall.core.analysis.truth import compare_with_truth, read_truth
from rockfall.core.errors import InputError
from rockfall.core.exchange.project import Project, read_project
from rockfall.core.exchange.tables import read_picks
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import Picks
from rockfall.core.reconstruction.trajectory import Reconstruction, reconstruct
from rockfall.core.terrain.raycast import closest_points
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.terrain.surface import Surface

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "assets" / "demo"
GRAVITY = np.array([0.0, 0.0, -9.81])

sys.path.insert(0, str(ROOT / "scripts"))
from making.demo_site import blocks, campaign, terrain  # noqa: E402


def vectors(rows: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[name] or "nan") for name in names] for row in rows])


@pytest.fixture(scope="module")
def project() -> Project:
    return read_project(DEMO / "project.toml")


@pytest.fixture(scope="module")
def surface(project: Project) -> Surface:
    assert project.terrain is not None
    return read_terrain(project.terrain.files[0], shift=project.terrain.global_shift, up=project.terrain.up)


@pytest.fixture(scope="module")
def picks(project: Project, surface: Surface) -> Picks:
    assert project.picks is not None
    return read_picks(project.picks, surface.shift)


@pytest.fixture(scope="module")
def truth() -> list[dict[str, str]]:
    with (DEMO / "truth.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def found(project: Project, surface: Surface, picks: Picks) -> Reconstruction:
    entries = {entry.name: entry for entry in project.blocks}
    block = {n: Block(e.d1_m, e.d2_m, e.d3_m, e.density_kgpm3) for n, e in entries.items()}
    return reconstruct(picks, surface=surface, block=block, normal_radius_m=project.reconstruction.normal_radius_m)


def test_size_of_the_folder() -> None:
    sizes = [file.stat().st_size for file in DEMO.rglob("*") if file.is_file()]
    assert sum(sizes) < 15e6
    assert max(sizes) < 8e6


def test_geometry_of_the_gully(surface: Surface) -> None:
    assert 290_000 < len(surface.faces) < 310_000
    assert np.ptp(surface.vertices[:, 2]) == pytest.approx(116.0, abs=1.0)
    assert surface.shift.crs == "EPSG:2154"
    assert np.abs(surface.shift.vector[:2]).min() > 900_000
    assert (surface.face_normals[:, 2] > 0).all()

    line = terrain.profile()
    x, y, z = terrain.to_local(surface.shift.to_survey(surface.vertices), line).T
    channel = np.abs(y - terrain.axis_y(x, line.apex_m)) < 0.6
    ends = np.cumsum([0.0, *(d / np.tan(np.radians(s)) for d, s in zip((42.1, 59.9, 10.2), (53, 40, 16), strict=True))])
    for start, end, slope_deg in zip(ends[:-1], ends[1:], (53.0, 40.0, 16.0), strict=True):
        part = channel & (x > start + 1.0) & (x < end - 1.0)
        assert np.degrees(np.arctan(-np.polyfit(x[part], z[part], 1)[0])) == pytest.approx(slope_deg, abs=2.0)
    # the channel's sides are steeper than its bed
    sides = (np.abs(y - terrain.axis_y(x, line.apex_m)) < 12.0) & ~channel & (x > 40.0) & (x < line.apex_m - 5.0)
    steepness = np.degrees(np.arccos(surface.vertex_normals[:, 2]))
    assert np.median(steepness[sides]) > 45.0


def test_the_campaign_exercises_every_kind_of_pick(picks: Picks) -> None:
    assert len(picks.group_starts) == 15
    counts = {kind: int((picks.kind == kind).sum()) for kind in ("release", "impact", "pass", "contact", "stop")}
    assert 90 <= counts["impact"] <= 115
    assert all(counts.values())
    assert (picks.status == "shattered").sum() == 1
    assert (picks.status == "doubtful").sum() == 1
    starts = picks.time_s[picks.group_starts]
    ends = picks.time_s[np.r_[picks.group_starts[1:], len(picks)] - 1]
    assert (starts[1:] - ends[:-1] > 5.0).all()  # one after the other


def test_true_flights_are_parabolas_above_the_terrain(surface: Surface, truth: list[dict[str, str]]) -> None:
    names = np.array([row["trajectory"] for row in truth])
    time, left = vectors(truth, "time_s")[:, 0], vectors(truth, "leave_time_s")[:, 0]
    centre = surface.shift.to_local(vectors(truth, "x_m", "y_m", "z_m"))
    leave = surface.shift.to_local(vectors(truth, "leave_x_m", "leave_y_m", "leave_z_m"))
    contact = surface.shift.to_local(vectors(truth, "contact_x_m", "contact_y_m", "contact_z_m"))
    v1 = vectors(truth, "v1x_mps", "v1y_mps", "v1z_mps")
    v2 = vectors(truth, "v2x_mps", "v2y_mps", "v2z_mps")
    radius = vectors(truth, "diameter_m")[:, 0] / 2.0

    touched = closest_points(surface, centre)
    np.testing.assert_allclose(touched.distance, radius, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(centre - contact, axis=1), radius, atol=1e-4)

    i = np.flatnonzero(names[1:] == names[:-1])
    seconds = (time[i + 1] - left[i])[:, None]
    np.testing.assert_allclose(leave[i] + v2[i] * seconds + GRAVITY * seconds**2 / 2, centre[i + 1], atol=1e-5)
    np.testing.assert_allclose(v2[i] + GRAVITY * seconds, v1[i + 1], atol=1e-6)
    energy = np.sum(v2[i] ** 2, axis=1) / 2 + 9.81 * leave[i][:, 2]
    np.testing.assert_allclose(np.sum(v1[i + 1] ** 2, axis=1) / 2 + 9.81 * centre[i + 1][:, 2], energy, rtol=1e-6)

    share = np.linspace(0.0, 1.0, 60)[None, :, None] * seconds[:, None]
    path = leave[i][:, None] + v2[i][:, None] * share + GRAVITY * share**2 / 2
    clearance = closest_points(surface, path.reshape(-1, 3)).distance.reshape(path.shape[:2]) - radius[i][:, None]
    assert clearance.min() > -1e-4
    assert seconds.min() > 0.15
    assert seconds.max() < 2.2
    assert 15.0 < np.linalg.norm(v1, axis=1).max() < 22.0


def test_no_impact_gains_energy(truth: list[dict[str, str]]) -> None:
    """Translation and rotation together (a cube's inertia), at impacts that are a single contact."""
    single = [row for row in truth if row["contacts"] == "1" and row["v2x_mps"]]
    k2 = 2.0 / 3.0 * (vectors(single, "diameter_m")[:, 0] / 2.0) ** 2

    def energy(part: int) -> np.ndarray:
        v = vectors(single, *(f"v{part}{axis}_mps" for axis in "xyz"))
        omega = vectors(single, *(f"omega{part}{axis}_radps" for axis in "xyz"))
        return np.sum(v**2, axis=1) + k2 * np.sum(omega**2, axis=1)

    assert len(single) > 80
    assert (energy(2) <= energy(1) * (1.0 + 1e-6)).all()


def test_picks_carry_the_stated_noise(surface: Surface, picks: Picks, truth: list[dict[str, str]]) -> None:
    frames = picks.extra["frame"].astype(int)
    np.testing.assert_allclose(picks.time_s * 30.0, frames, atol=1e-4)
    impact = picks.kind == "impact"
    assert picks.trajectory[impact].tolist() == [row["trajectory"] for row in truth]

    late = picks.time_s[impact] - vectors(truth, "time_s")[:, 0]
    assert np.abs(late).max() <= 1.0 / 60.0 + 1e-6
    assert late.std() == pytest.approx(picks.sigma_time_s[impact][0], rel=0.15)
    assert picks.sigma_time_s[impact][0] == pytest.approx(1 / 30 / np.sqrt(12), rel=0.01)

    contact = surface.shift.to_local(vectors(truth, "contact_x_m", "contact_y_m", "contact_z_m"))
    beside = np.linalg.norm(picks.position[impact] - contact, axis=1)
    assert np.sqrt(np.mean(beside**2) / 2.0) == pytest.approx(picks.sigma_position_m[impact][0], rel=0.2)
    on_ground = picks.kind != "pass"
    assert closest_points(surface, picks.position[on_ground]).distance.max() < 0.002


def test_the_reconstruction_finds_the_truth(found: Reconstruction) -> None:
    deviations = {one.name: one for one in compare_with_truth(found.impacts, read_truth(DEMO / "truth.csv"))}
    assert deviations["|v1|"].n > 90
    assert deviations["R"].n > 75
    assert deviations["|v1|"].median < 0.25
    assert deviations["|v2|"].median < 0.30
    assert deviations["v1 (vector)"].median < 0.45
    assert deviations["R"].median < 0.04
    assert deviations["R_T"].median < 0.05
    assert deviations["R_N"].median < 0.11
    assert deviations["θ1"].median < 2.0
    assert deviations["normal"].median < 4.0
    for name in ("R", "R_T", "R_N"):
        assert abs(deviations[name].bias) < 0.02
    assert not found.impacts.flags["departing"].any()


def test_statistics_look_like_the_papers(found: Reconstruction) -> None:
    statistics = impact_statistics(found.impacts)
    assert statistics.used > 75
    assert 0.45 < statistics.rt.slope < 0.75
    assert statistics.rn_angle.high < -0.7
    assert statistics.rn_above_one_grazing >= 0.8 * statistics.rn_above_one > 10
    assert statistics.r_deviation.slope < 0.0


def test_the_script_makes_these_files(surface: Surface) -> None:
    """The terrain, and one block on the terrain as it is stored: bouncing is chaotic, so machines could differ else."""
    field = campaign.Campaign(2017)
    stored = surface.shift.to_survey(surface.vertices)
    off = np.abs(field.terrain.survey - stored).max(axis=1)
    assert np.mean(off < 0.0011) > 0.999
    np.testing.assert_array_equal(field.terrain.faces, surface.faces)

    observed = field.observed(2)
    truth = read_truth(DEMO / "truth.csv")
    mine = truth.trajectory == observed.name
    assert len(observed.impacts) == mine.sum()
    times = [observed.start_s + impact.time for impact in observed.impacts]
    np.testing.assert_allclose(times, truth.time_s[mine], atol=1e-6)
    marked = campaign.in_survey(field.picks(observed), field.terrain.line)
    with (DEMO / "picks.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["trajectory"] == observed.name]
    np.testing.assert_allclose([pick.position for pick in marked], vectors(rows, "x_m", "y_m", "z_m"), atol=6e-4)
    assert [pick.frame for pick in marked] == [int(row["frame"]) for row in rows]


def test_rebound_law_against_the_published_vectors() -> None:
    """The mean law for the case that needs neither cap nor transfer (Noël et al. 2017)."""

    class Mean:
        @staticmethod
        def normal(mean: float, _: float) -> float:
            return mean

    up = np.array([0.0, 0.0, 1.0])
    for spin, v2, omega2 in (
        ((0, 0, 0), (3.312, 0.0, 1.860413), 27.42857),
        ((0, 40, 0), (5.244, 0.0, 1.860413), 43.42857),
    ):
        v, omega = blocks.rebound(np.array([8.0, 0.0, -6.0]), np.array(spin, float), 0.175, up, Mean())  # type: ignore[arg-type]
        np.testing.assert_allclose(v, v2, atol=1e-6)
        np.testing.assert_allclose(omega, [0.0, omega2, 0.0], atol=1e-5)
    v, _ = blocks.rebound(np.array([12.0, 0.0, -0.5]), np.array([0.0, 60.0, 0.0]), 0.175, up, Mean())  # type: ignore[arg-type]
    np.testing.assert_allclose(v, [7.818181, 0.0, 1.0], atol=1e-6)


def test_bad_truth_tables(tmp_path: Path, found: Reconstruction) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_truth(tmp_path / "none.csv")
    text = (DEMO / "truth.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "t.csv").write_text(text[0].replace("v1x_mps", "v1x"), encoding="utf-8")
    with pytest.raises(InputError, match="lacks the column v1x_mps"):
        read_truth(tmp_path / "t.csv")
    (tmp_path / "t.csv").write_text("\n".join([text[0], text[1].replace("B01,1", "B01,one")]), encoding="utf-8")
    with pytest.raises(InputError, match="row 2: impact is 'one'"):
        read_truth(tmp_path / "t.csv")
    (tmp_path / "t.csv").write_text(text[0] + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="No impact"):
        compare_with_truth(found.impacts, read_truth(tmp_path / "t.csv"))
