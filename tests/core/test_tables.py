# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables: what is written is what is read, and every mistake is located."""

from dataclasses import fields

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange.tables import (
    read_impacts,
    read_picks,
    write_impacts,
    write_picks,
    write_trajectories,
)
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.impact import Impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.sampling import sample_trajectories
from rockfall.core.reconstruction.trajectory import reconstruct

HEADER = (
    "site,trajectory,impact,time_s,x_m,y_m,z_m,nx,ny,nz,normal_radius_m,v1x_mps,v1y_mps,v1z_mps,v2x_mps,v2y_mps,v2z_mps,"
    "vn1_mps,vt1_mps,vn2_mps,vt2_mps,rn,rt,r,theta1_deg,theta_dev_deg,diameter_m,mass_kg,flags"
)
SHIFT = GlobalShift(2_793_300.0, 1_180_200.0, 2300.0, "EPSG:2056")


def picks(n=6, **more):
    rng = np.random.default_rng(3)
    names = ["a"] * (n // 2) + ["b"] * (n - n // 2)
    return make_picks(
        names,
        np.arange(n) * 0.7 + 1691.92,
        np.arange(n)[:, None] * [3.0, 0.1, -4] + rng.normal(size=(n, 3)),
        normal=np.tile([0.3, 0.1, 0.9], (n, 1)),
        shift=SHIFT,
        **more,
    )


FULL = {
    "sigma_time_s": np.full(6, 0.01),
    "sigma_position_m": np.full(6, 0.1),
    "angular_velocity": np.arange(18.0).reshape(6, 3),
}


def assert_equal_impacts(one, other, rtol=1e-14):
    for field in fields(Impacts):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name in ("flags", "sigma", "intervals"):
            assert set(a) == set(b)
            for name in a:
                np.testing.assert_allclose(a[name], b[name], rtol=rtol)
        elif field.name in ("site", "trajectory"):
            assert a.tolist() == b.tolist()
        elif field.name not in ("extra", "shift"):
            atol = 1e-9 if field.name == "position" else 0  # half the spacing of doubles at 2 793 300 m is 2e-10
            np.testing.assert_allclose(a, b, rtol=rtol, atol=atol, err_msg=field.name)


def test_impacts_have_the_columns_of_the_format_in_order(tmp_path):
    write_impacts(reconstruct(picks(), site="gully").impacts, tmp_path / "impacts.csv")
    lines = (tmp_path / "impacts.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith(HEADER + ",")
    assert "sigma" not in lines[0]
    assert lines[1].startswith("gully,a,1,1691.92,")
    assert len(lines) == 7


def test_impacts_round_trip(tmp_path):
    impacts = reconstruct(picks(**FULL), site="gully").impacts
    write_impacts(impacts, tmp_path / "one.csv")
    again = read_impacts(tmp_path / "one.csv", SHIFT)
    assert_equal_impacts(again, impacts)
    write_impacts(again, tmp_path / "two.csv")
    third = read_impacts(tmp_path / "two.csv", SHIFT)
    assert_equal_impacts(third, impacts)
    header = (tmp_path / "one.csv").read_text(encoding="utf-8").splitlines()[0]
    after = header.removeprefix(HEADER).split(",")[1:]
    assert after[:3] == ["sigma_v1x_mps", "sigma_v1y_mps", "sigma_v1z_mps"]
    assert "sigma_theta_dev_deg" in after
    assert after.index("omega1x_radps") > after.index("sigma_theta_dev_deg")


def test_empty_cells_are_undefined_and_unknown_columns_are_kept(tmp_path):
    table = tmp_path / "impacts.csv"
    row = "gully,a,1,0,1,2,3,0,0,1,,1,0,-2,,,,,,,,,,,,,,,first;odd,wet"
    table.write_text(f"{HEADER},soil\n{row}\n", encoding="utf-8")
    impacts = read_impacts(table)
    assert np.isnan(impacts.v2).all()
    assert impacts.flags["first"].tolist() == [True]
    write_impacts(impacts, table)
    assert table.read_text(encoding="utf-8").splitlines()[0].endswith("soil")
    assert table.read_text(encoding="utf-8").splitlines()[1].endswith("wet")


def test_a_short_table_of_impacts_gets_its_coefficients_computed(tmp_path):
    table = tmp_path / "impacts.csv"
    table.write_text(
        "trajectory,nx,ny,nz,v1x_mps,v1y_mps,v1z_mps,v2x_mps,v2y_mps,v2z_mps\n"
        "a,0,0,1,5,0,-3.924,6,2,2.4525\n"
        "a,0,0,1,8,0,3,8,0,3\n",
        encoding="utf-8",
    )
    impacts = read_impacts(table)
    assert impacts.rn[0] == pytest.approx(0.625)
    assert np.degrees(impacts.theta1[0]) == pytest.approx(38.124823, abs=1e-6)
    assert np.isnan(impacts.rn[1])
    assert impacts.flag_text() == ["", "departing"]


def test_picks_round_trip_without_losing_a_digit_or_a_column(tmp_path):
    table = tmp_path / "picks.csv"
    text = (
        "trajectory,time_s,x_m,y_m,z_m,kind,status,sigma_time_s,video,note\n"
        "a,1691.92,2793293.57,1180191.09,2307.06,release,ok,0.01,left.mp4,\n"
        'a,1692.89,2793297.18,1180181.46,2299.46,impact,doubtful,,left.mp4,"near the fir, hidden"\n'
    )
    table.write_text(text, encoding="utf-8")
    read = read_picks(table)
    assert read.shift == GlobalShift(2_793_300.0, 1_180_200.0, 0.0)
    assert read.row.tolist() == [2, 3]
    write_picks(read, table)
    assert table.read_text(encoding="utf-8") == text


def test_all_optional_columns_of_picks_round_trip(tmp_path):
    one = picks(**FULL, status=["ok", "shattered", "ok", "ok", "discarded", "ok"])
    write_picks(one, tmp_path / "picks.csv")
    other = read_picks(tmp_path / "picks.csv", SHIFT)
    for name in ("trajectory", "time_s", "kind", "status", "sigma_time_s", "angular_velocity"):
        np.testing.assert_array_equal(getattr(other, name), getattr(one, name))
    np.testing.assert_allclose(other.position, one.position, atol=1e-9)
    np.testing.assert_allclose(other.normal, one.normal, rtol=1e-15)


def test_defaults_blank_lines_blanks_and_a_byte_order_mark(tmp_path):
    table = tmp_path / "picks.csv"
    rows = "\n\n a , 1 ,2,3,4,\r\n\na,2,3,3,4,stop\n\n"
    table.write_text("\ufefftrajectory,time_s,x_m,y_m,z_m,kind" + rows, encoding="utf-8")
    read = read_picks(table)
    assert read.kind.tolist() == ["impact", "stop"]
    assert read.status.tolist() == ["ok", "ok"]
    assert read.row.tolist() == [3, 5]


def test_trajectories_have_the_columns_of_the_format(tmp_path):
    result = reconstruct(picks())
    samples = sample_trajectories(result, 0.25)
    write_trajectories(samples, tmp_path / "trajectories.csv")
    lines = (tmp_path / "trajectories.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "source,trajectory,run,time_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps,height_m,kinetic_J"
    first = lines[1].split(",")
    assert first[:3] == ["observed", "a", "1"]
    assert float(first[4]) == pytest.approx(result.picks.position[0, 0] + SHIFT.x, abs=1e-6)
    assert len(lines) == len(samples) + 1


def test_a_million_metres_away_positions_are_exact(tmp_path):
    survey = np.array([[2_600_000.123456, 1_200_000.654321, 1234.000001], [2_600_001.5, 1_200_001.25, 1230.75]])
    one = make_picks(["a", "a"], [0, 1], SHIFT.to_local(survey), shift=SHIFT)
    write_picks(one, tmp_path / "picks.csv")
    other = read_picks(tmp_path / "picks.csv")
    np.testing.assert_allclose(other.shift.to_survey(other.position), survey, atol=1e-9)


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("mark", [".", ","])
def test_a_table_as_spreadsheets_in_europe_write_it_is_read(tmp_path, separator, mark):
    rows = [
        "trajectory,time_s,x_m,y_m,z_m,width_m,note",
        "a,0,0.5,-1.25,1e-2,0.75,x",
        "a,1.5,3.5,2.0,0.0,0.5,wet",
        '"b",0,1,2,3,,',
    ]
    text = "\n".join(row.replace(",", separator).replace(".", mark) for row in rows) + "\n"
    (tmp_path / "a.csv").write_text(text)
    picks = read_picks(tmp_path / "a.csv")
    np.testing.assert_array_equal(picks.time_s, [0.0, 1.5, 0.0])
    np.testing.assert_array_equal(picks.position, [[0.5, -1.25, 0.01], [3.5, 2.0, 0.0], [1.0, 2.0, 3.0]])
    assert picks.trajectory.tolist() == ["a", "a", "b"]
    assert picks.extra["width_m"].tolist() == ["0.75", "0.5", ""]
    assert picks.extra["note"].tolist() == ["x", "wet", ""]


GOOD = "trajectory,time_s,x_m,y_m,z_m\na,0,0,0,0\na,1,3,0,0\n"
BAD_PICKS = {
    "empty": ("", None, "empty"),
    "only blanks": ("\n  \n", None, "empty"),
    "header only": ("trajectory,time_s,x_m,y_m,z_m\n", None, "no rows"),
    "missing column": (
        "trajectory,time,x_m,y_m,z_m\na,0,0,0,0\n",
        1,
        "column time_s is missing; found: trajectory, time, ",
    ),
    "near match": ("trajectory,time,x_m,y_m,z_m\na,0,0,0,0\n", 1, "Rename time to time_s"),
    "two missing": ("trajectory,time_s,x,y,z_m\na,0,0,0,0\n", 1, "columns x_m, y_m are missing"),
    "another separator": ("trajectory|time_s|x_m|y_m|z_m\na|0|0|0|0\n", 1, "columns trajectory, time_s"),
    "both decimal marks": (
        "trajectory;time_s;x_m;y_m;z_m\na;0;0;0;0\na;1;3,5;2.5;0\n",
        3,
        "Write decimals with a point",
    ),
    "column twice": ("trajectory,time_s,x_m,y_m,z_m,x_m\na,0,0,0,0,0\n", 1, "x_m is there 2 times"),
    "unnamed column": ("trajectory,time_s,x_m,y_m,z_m,\na,0,0,0,0,\na,1,0,0,0,hm\n", 3, "Column 6 has no name"),
    "non-number": (GOOD.replace("a,1,3", "a,1,3o"), 3, "'3o' in column x_m is not a number"),
    "decimal comma": (GOOD.replace("a,1,3", 'a,1,"3,5"'), 3, "Write decimals with a point"),
    "underscore": (GOOD.replace("a,1,3", "a,1,1_000"), 3, "'1_000' in column x_m is not a number"),
    "nan": (GOOD.replace("a,1,3", "a,nan,3"), 3, "'nan' in column time_s is not finite"),
    "inf": (GOOD.replace("a,1,3", "a,1,-inf"), 3, "not finite"),
    "empty cell": (GOOD.replace("a,1,3", "a,,3"), 3, "cell of time_s is empty"),
    "no name": (GOOD.replace("a,1,3", ",1,3"), 3, "no name"),
    "same time": (GOOD.replace("a,1,3", "a,0,3"), 3, "Two picks at one time, 0.0 s (the other one is in row 2)"),
    "unsorted": (GOOD + "a,0.5,0,0,0\n", 4, "not sorted: 0.5 s comes after 1.0 s in row 3"),
    "long row": (GOOD + "a,2,0,0,0,7\n", 4, "6 cells, the header has 5"),
    "short row": (GOOD + "a,2,0\n", 4, "3 cells, the header has 5"),
    "open quote": (GOOD + '"a,2,0,0,0\n', 4, "quote"),
    "kind": ("trajectory,time_s,x_m,y_m,z_m,kind\na,0,0,0,0,imapct\n", 2, "Did you mean impact?"),
    "status": ("trajectory,time_s,x_m,y_m,z_m,status\na,0,0,0,0,gone\n", 2, "Use one of ok, doubtful"),
    "zero normal": ("trajectory,time_s,x_m,y_m,z_m,nx,ny,nz\na,0,0,0,0,0,0,0\n", 2, "length zero"),
    "half a normal": ("trajectory,time_s,x_m,y_m,z_m,nx,ny,nz\na,0,0,0,0,0,,1\n", 2, "part of the terrain normal"),
    "negative sigma": ("trajectory,time_s,x_m,y_m,z_m,sigma_time_s\na,0,0,0,0,-1\n", 2, "not a standard deviation"),
    "quoted newline": (
        'trajectory,time_s,x_m,y_m,z_m,note\na,0,0,0,0,"two\nlines"\na,x,0,0,0,\n',
        4,
        "'x' in column time_s",
    ),
}


@pytest.mark.parametrize("case", BAD_PICKS)
def test_bad_tables_are_refused_with_their_row(tmp_path, case):
    text, row, message = BAD_PICKS[case]
    table = tmp_path / "picks.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_picks(table)
    assert caught.value.row == row
    assert message in str(caught.value)
    assert str(table) in str(caught.value)
    assert caught.value.advice


def test_picks_in_other_units_are_converted(tmp_path):
    """Each factor by value: milliseconds, feet, centimetres, kilometres, millimetres, revolutions a minute, degrees."""
    table = tmp_path / "picks.csv"
    units = "time_ms,x_ft,y_cm,z_km,sigma_time_min,sigma_position_mm,omega1x_rpm,omega1y_deg/s,omega1z_rad/s"
    rows = "a,1500,100,250,1.5,0.5,35,60,180,2,7", "a,2500,1,1,1,,,,,,"
    table.write_text("\n".join((f"trajectory,{units},note_m", *rows)), encoding="utf-8")
    read = read_picks(table)
    survey = read.shift.to_survey(read.position)
    np.testing.assert_allclose(read.time_s, [1.5, 2.5], rtol=1e-15)
    np.testing.assert_allclose(survey, [[30.48, 2.5, 1500.0], [0.3048, 0.01, 1000.0]], rtol=1e-14)
    np.testing.assert_allclose(read.sigma_time_s, [30.0, np.nan], rtol=1e-15)
    np.testing.assert_allclose(read.sigma_position_m, [0.035, np.nan], rtol=1e-15)
    np.testing.assert_allclose(read.angular_velocity[0], [2 * np.pi, np.pi, 2.0], rtol=1e-15)
    assert read.extra.keys() == {"note_m"}
    write_picks(read, table)
    np.testing.assert_allclose(read_picks(table).sigma_position_m, read.sigma_position_m)


IMPACT = "trajectory,nx,ny,nz,v2x_mps,v2y_mps,v2z_mps,"


def test_impacts_in_other_units_are_converted(tmp_path):
    """km/h divided by 3.6, 180/π degrees a radian, tonnes, kilojoules; a number that is wrong has the file's name."""
    table = tmp_path / "impacts.csv"
    header = f"{IMPACT}v1x_kmh,v1y_km/h,v1z_fps,theta1_rad,sigma_rn,sigma_vn1_cmps,mass_t,diameter_mm,kinetic1_kJ"
    table.write_text(f"{header}\na,0,0,1,1,0,2,36,7.2,-10,0.5,0.1,20,0.06,350,12\n", encoding="utf-8")
    read = read_impacts(table)
    np.testing.assert_allclose(read.v1, [[10.0, 2.0, -3.048]], rtol=1e-15)
    np.testing.assert_allclose(read.theta1, [0.5], rtol=1e-15)
    assert (read.mass_kg[0], read.diameter_m[0], read.kinetic1_j[0]) == pytest.approx((60.0, 0.35, 12000.0), rel=1e-15)
    assert (read.sigma["rn"][0], read.sigma["vn1"][0]) == pytest.approx((0.1, 0.2), rel=1e-15)
    assert not read.extra
    table.write_text(f"{header}\na,0,0,1,1,0,2,36,fast,-10,0.5,,,0.06,350,12\n", encoding="utf-8")
    with pytest.raises(InputError, match="row 2, trajectory a: 'fast' in column v1y_km/h is not a number"):
        read_impacts(table)


def test_a_column_of_ours_is_taken_and_the_other_unit_kept(tmp_path):
    table = tmp_path / "picks.csv"
    table.write_text("trajectory,time_s,x_m,y_m,z_m,time_ms,time_zone,sigma_note\na,1,0,0,0,999,7,\n", encoding="utf-8")
    read = read_picks(table)
    assert read.time_s[0] == 1.0
    assert read.extra["time_ms"].tolist() == ["999"]
    assert read.extra["time_zone"].tolist() == ["7"]
    table.write_text("trajectory,time_s,x_m,y_m,z_m,sigma_position_by\na,1,0,0,0,eye\n", encoding="utf-8")
    assert read_picks(table).extra["sigma_position_by"].tolist() == ["eye"]


BAD_UNITS = {
    "required": (
        "v1x_knots,v1y_mps,v1z_mps",
        "The column v1x_knots is v1x_mps in a unit that is not known. Convert it to m/s",
    ),
    "metres and milliseconds": ("v1x_ms,v1y_mps,v1z_mps", "The column v1x_ms is v1x_mps in a unit that is not known"),
    "optional": ("v1x_mps,v1y_mps,v1z_mps,diameter_inch", "rename it to diameter_m; known are mm, cm, km, ft"),
    "two": ("v1x_kmh,v1x_fps,v1y_mps,v1z_mps", "The columns v1x_kmh and v1x_fps are both v1x_mps in another unit"),
    "no unit": ("v1x,v1y_mps,v1z_mps", "Rename v1x to v1x_mps if it is in m/s"),
}


@pytest.mark.parametrize("case", BAD_UNITS)
def test_unknown_units_are_refused(tmp_path, case):
    columns, message = BAD_UNITS[case]
    table = tmp_path / "t.csv"
    table.write_text(f"{IMPACT}{columns}\na,0,0,1,1,0,2{',1' * len(columns.split(','))}\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_impacts(table)
    assert message in str(caught.value).removeprefix(str(table))
    assert (caught.value.file, caught.value.row) == (table, 1)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "binary"),
        (GOOD.encode("utf-16")[:-1], "marked as UTF-16, and is not"),
        (GOOD.replace("a,1", "Bl\u00f6cke,1").encode("latin-1"), "not in UTF-8"),
    ],
)
def test_what_is_not_text_in_utf_8_is_refused(tmp_path, data, message):
    table = tmp_path / "picks.csv"
    table.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_picks(table)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_picks(tmp_path / "none.csv")
    with pytest.raises(InputError, match=r"This is a folder\. Choose the table itself"):
        read_picks(tmp_path)
