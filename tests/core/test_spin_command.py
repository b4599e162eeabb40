# SPDX-License-Identifier: GPL-3.0-or-later
"""rockfall spin: marks of a filmed block that SciPy turns → spin.csv, and impacts for compare --spin table."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.exchange.cameras import write_camera
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.spin_tables import read_spin_marks, write_spin_marks
from rockfall.core.exchange.tables import read_impacts, read_picks
from rockfall.core.georeference import GlobalShift
from scipy.spatial.transform import Rotation

SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 1_000.0)
RADIUS, GRAVITY = 0.25, np.array([0.0, 0.0, -9.81])
KNOTS = np.array([10.0, 10.9, 11.7])
PLACES = np.array([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0], [12.0, 0.0, 0.0]])
"""Of the contacts: two flights on level ground."""
CAMERA = replace(look_at(1920, 1080, [6.0, -14.0, 2.0], [6.0, 0.0, 1.0], focal_px=1800), shift=SHIFT)
OFFSET = 8.0
OMEGA = np.array([[0.0, 2 * np.pi * 3.5, 0.0], [0.0, 2 * np.pi * 5.2, 0.0]])
"""Of the two flights: at 25 pictures per second two of them tell the first one; nothing tells the second one."""
PROJECT = """schema = 1
[picks]
file = "picks.csv"
[block]
d1_m = 0.5
d2_m = 0.5
d3_m = 0.5
density_kgpm3 = 2700.0
[[videos]]
name = "side"
camera = "side.toml"
spin_marks = "marks.csv"
offset_s = 8.0
"""


def centre(k, time):
    t, span = (np.asarray(time) - KNOTS[k])[:, None], KNOTS[k + 1] - KNOTS[k]
    start = (PLACES[k + 1] - PLACES[k]) / span - 0.5 * GRAVITY * span
    return PLACES[k] + [0, 0, RADIUS] + start * t + 0.5 * GRAVITY * t**2


def pixels(k, time):
    turned = Rotation.from_rotvec(np.outer(np.asarray(time) - time[0], OMEGA[k])).apply([0.48, -0.6, 0.64])
    return project(CAMERA, centre(k, time) + RADIUS * turned)


@pytest.fixture
def site(tmp_path):
    folder = tmp_path / "site"
    folder.mkdir()
    write_camera(folder / "side.toml", fixed(CAMERA))
    rows = ["trajectory,time_s,x_m,y_m,z_m,nx,ny,nz"]
    rows += [
        f"B1,{t},{','.join(map(repr, p))},0,0,1"
        for t, p in zip(KNOTS.tolist(), SHIFT.to_survey(PLACES).tolist(), strict=True)
    ]
    (folder / "picks.csv").write_text("\n".join(rows) + "\n")
    rows = ["trajectory,frame,time_s,u_px,v_px,sigma_px"]
    for k, time in enumerate((np.array([10.40, 10.44, 10.48]), np.array([11.20, 11.32]))):
        for t, (u, v) in zip(time.tolist(), pixels(k, time).tolist(), strict=True):
            rows.append(f"B1,{round((t - OFFSET) * 25)},{t - OFFSET!r},{u!r},{v!r},0.7")
    (folder / "marks.csv").write_text("\n".join(rows) + "\n")
    (folder / "project.toml").write_text(PROJECT)
    return folder


def test_a_project_with_marks(site, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["spin", str(site / "project.toml"), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "The spin of 1 of 2 marked flights is known." in said
    assert "B1, flight 1: 3.50 ± " in said
    assert "turns/s fit alike" in said
    table = read_table(out / "spin.csv", ("trajectory", "flight"), ())
    assert table.text("verdict") == ["measured", "ambiguous"]
    assert table.text("impact") == ["2", "3"]
    assert "the block rolls forwards (assumed)" in table.text("axis_in_words")[0]
    assert table.numbers("omega_radps")[0] == pytest.approx(OMEGA[0, 1], abs=0.01)
    energy = 0.5 * 0.4 * (4 / 3 * np.pi * RADIUS**3 * 2700) * RADIUS**2 * OMEGA[0, 1] ** 2
    assert table.numbers("rotational_J")[0] == pytest.approx(energy, rel=1e-3)
    assert np.isnan(table.numbers("omega_radps")[1])
    assert "-3.1;5.2" in table.text("others_turns_per_s")[1].replace("-3.133", "-3.1")
    omega = read_impacts(out / "impacts.csv").angular_velocity
    np.testing.assert_allclose(omega[1], OMEGA[0], atol=0.01)
    assert np.isnan(omega[[0, 2]]).all()
    np.testing.assert_allclose(read_picks(out / "picks.csv").angular_velocity[1], OMEGA[0], atol=0.01)
    compared = [str(out / "impacts.csv"), "--spin", "table", "--tables-only", "--out", str(tmp_path / "compared")]
    assert main(["compare", *compared]) == 0
    said = capsys.readouterr().out
    assert "1 of 3 impacts compared" in said
    assert "1 with no measured angular velocity" in said


def test_a_counted_rate_in_the_table_decides(site, tmp_path):
    lines = (site / "marks.csv").read_text().splitlines()
    lines = [lines[0] + ",counted_turns_per_s", *(f"{line}," for line in lines[1:-1]), f"{lines[-1]},5"]
    (site / "marks.csv").write_text("\n".join(lines) + "\n")
    assert main(["spin", str(site / "project.toml"), "--out", str(tmp_path / "out")]) == 0
    table = read_table(tmp_path / "out" / "spin.csv", ("trajectory", "flight"), ())
    assert table.text("verdict") == ["measured", "counted"]
    assert table.numbers("turns_per_s")[1] == pytest.approx(5.2, abs=0.01)


def test_marks_are_written_as_they_were_read(site, tmp_path):
    marks = read_spin_marks(site / "marks.csv")
    write_spin_marks(marks, tmp_path / "again.csv")
    again = read_spin_marks(tmp_path / "again.csv")
    for name in ("trajectory", "frame", "time_s", "pixel", "sigma_px", "axis", "about"):
        np.testing.assert_array_equal(getattr(again, name), getattr(marks, name))


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        (
            "marks.csv",
            lambda text: text.replace("sigma_px", "axis").replace(",0.7", ",up"),
            "row 2, trajectory B1: Unknown axis 'up'",
        ),
        ("marks.csv", lambda text: text.replace("B1,60", ",60"), "The mark names no trajectory"),
        (
            "project.toml",
            lambda text: text.replace('spin_marks = "marks.csv"\n', ""),
            "No video of the project has marks",
        ),
        ("project.toml", lambda text: text.replace('camera = "side.toml"\n', ""), "marks of spins, but no camera"),
    ],
)
def test_what_is_refused(site, tmp_path, capsys, name, change, said):
    path = site / name
    changed = change(path.read_text())
    assert changed != path.read_text()
    path.write_text(changed)
    assert main(["spin", str(site / "project.toml"), "--out", str(tmp_path / "out")]) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_missing_column_is_named(tmp_path):
    (tmp_path / "marks.csv").write_text("trajectory,u_px,v_px\nB1,1,2\n")
    with pytest.raises(InputError, match="time_s"):
        read_spin_marks(tmp_path / "marks.csv")
