# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of several sites become one: sources, units, duplicates, conditions, groups, and a package to share."""

import csv
import json
import math
from dataclasses import fields, replace

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.exchange.database import digest, merge, read_source
from rockfall.core.exchange.datapackage import read_package, write_package
from rockfall.core.exchange.duplicates import find_duplicates
from rockfall.core.exchange.impact_fields import FIELDS
from rockfall.core.exchange.selection import group_medians, joined, matching, rows_of
from rockfall.core.exchange.tables import IMPACTS_COLUMNS, impact_columns, read_impacts, write_impacts
from rockfall.core.exchange.unit_checks import check_units
from rockfall.core.reconstruction.impact import Impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct


def bounces(site="gully", names=("a", "b"), each=7, seed=3, origin=(0.0, 0.0, 0.0)):
    """Impacts down a slope of 35°; the first and the last of each trajectory lack a velocity."""
    rng = np.random.default_rng(seed)
    n = len(names) * each
    step = rng.uniform(0.4, 1.2, n)
    position = origin + np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(n, 3)) * 0.3, axis=0)
    normal = np.array([0.57, 0, 0.82]) + 0.05 * rng.normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return reconstruct(make_picks(np.repeat(names, each), np.cumsum(step), position, normal=normal), site=site).impacts


@pytest.fixture
def tables(tmp_path):
    """Two sites far from each other."""
    write_impacts(bounces(), tmp_path / "one.csv")
    write_impacts(bounces("quarry", ("a",), seed=4, origin=(2.6e6, 1.2e6, 500.0)), tmp_path / "two.csv")
    return tmp_path / "one.csv", tmp_path / "two.csv"


def assert_same(one, other):
    for field in fields(Impacts):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            check = np.testing.assert_allclose if a.dtype.kind == "f" else np.testing.assert_array_equal
            check(a, b, err_msg=field.name, **({"rtol": 1e-15} if a.dtype.kind == "f" else {}))
        elif field.name != "shift":
            assert a.keys() == b.keys()
            for name in a:
                np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_two_sites_become_one_table_that_knows_its_sources(tables):
    parts = [read_source(path, licence=licence) for path, licence in zip(tables, ("CC0-1.0", "CC-BY-4.0"), strict=True)]
    database = merge(parts).database
    assert len(database) == 21
    assert [source.sites for source in database.sources] == [("gully",), ("quarry",)]
    assert [source.impacts for source in database.sources] == [14, 7]
    assert database.sources[1].sha256 == digest(tables[1])
    assert database.sources[0].diameter_m == (0.35, 0.35)
    assert math.isnan(database.sources[0].normal_radius_m[0])
    assert database.source.tolist() == [0] * 14 + [1] * 7
    survey = database.impacts.shift.to_survey(database.impacts.position)
    for path, rows in zip(tables, (slice(0, 14), slice(14, 21)), strict=True):
        alone = read_impacts(path)
        np.testing.assert_allclose(survey[rows], alone.shift.to_survey(alone.position), atol=1e-8)
        np.testing.assert_array_equal(database.impacts.v2[rows], alone.v2)
        np.testing.assert_array_equal(database.impacts.theta1[rows], alone.theta1)


def test_a_package_is_read_as_it_was_written(tables, tmp_path):
    database = merge([read_source(path, licence="CC0-1.0") for path in tables]).database
    out = tmp_path / "package"
    out.mkdir()
    write_package(database, out)
    for path in (out, out / "datapackage.json"):
        again = read_package(path)
        assert [repr(source) for source in again.sources] == [repr(source) for source in database.sources]
        assert again.source.tolist() == database.source.tolist()
        positions = [one.impacts.shift.to_survey(one.impacts.position) for one in (again, database)]
        np.testing.assert_allclose(*positions, atol=1e-8)
        assert_same(replace(again.impacts, position=database.impacts.position), database.impacts)


def test_the_package_describes_every_column(tables, tmp_path):
    """As the standard asks: each column has a field, in order, and every cell keeps to its type and limits."""
    write_package(merge([read_source(path, licence="CC0-1.0") for path in tables]).database, tmp_path)
    package = json.loads((tmp_path / "datapackage.json").read_text(encoding="utf-8"))
    (resource,) = package["resources"]
    with (tmp_path / resource["path"]).open(encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    schema = resource["schema"]
    assert [field["name"] for field in schema["fields"]] == header
    assert resource["hash"] == f"sha256:{digest(tmp_path / 'impacts.csv')}"
    assert package["licenses"] == [{"name": "CC0-1.0"}]
    assert schema["primaryKey"] == ["site", "trajectory", "impact"]
    for i, field in enumerate(schema["fields"]):
        assert field["description"]
        limits = field.get("constraints", {})
        for row in rows:
            assert row[i] or not limits.get("required")
            if row[i] and field["type"] != "string":
                value = {"number": float, "integer": int}[field["type"]](row[i])
                assert limits.get("minimum", -math.inf) <= value <= limits.get("maximum", math.inf)
    assert set(IMPACTS_COLUMNS) < set(FIELDS)
    assert set(impact_columns(bounces())) <= set(FIELDS)


def test_a_changed_package_is_refused(tables, tmp_path):
    write_package(read_source(tables[0]), tmp_path)
    text = (tmp_path / "impacts.csv").read_text(encoding="utf-8")
    (tmp_path / "impacts.csv").write_text(text.replace("gully", "other"), encoding="utf-8")
    with pytest.raises(InputError, match="was changed since its package was written"):
        read_package(tmp_path)
    descriptor = tmp_path / "datapackage.json"
    for bad, message in (
        ("{", "JSON of the package cannot be read"),
        ("{}", "no package of impacts"),
        ('{"resources": [3]}', "no package of"),
    ):
        descriptor.write_text(bad, encoding="utf-8")
        with pytest.raises(InputError, match=message):
            read_package(tmp_path)
    with pytest.raises(InputError, match=r"none\.json: There is no such file"):
        read_package(tmp_path / "none.json")
    outside = {"resources": [{"path": "../one.csv", "hash": ""}], "sources": []}
    descriptor.write_text(json.dumps(outside), encoding="utf-8")
    with pytest.raises(InputError, match="outside the package"):
        read_package(tmp_path)


def test_a_row_of_a_source_that_the_package_does_not_name_is_refused(tables, tmp_path):
    write_package(merge([read_source(path) for path in tables]).database, tmp_path)
    descriptor = tmp_path / "datapackage.json"
    content = json.loads(descriptor.read_text(encoding="utf-8"))
    descriptor.write_text(json.dumps({**content, "sources": content["sources"][:1]}), encoding="utf-8")
    with pytest.raises(InputError, match=r"impacts\.csv: A row has the source '2', of 1\. Write the package again"):
        read_package(tmp_path)


def test_duplicates_are_found_under_any_name():
    base = bounces()
    known = np.flatnonzero(np.isfinite(base.v1).all(axis=1) & np.isfinite(base.v2).all(axis=1))
    moved = replace(base, time_s=base.time_s + 5e-4, position=base.position + 0.004, v1=base.v1 + 0.1)
    renamed = replace(base, site=np.full(len(base), "elsewhere"), position=base.position + 100)
    other = bounces("elsewhere", seed=9)
    for table, expected, other_name in ((moved, range(14), False), (renamed, known, True), (other, (), False)):
        found = find_duplicates(joined([base, table]))
        assert found.row.tolist() == [14 + i for i in expected]
        assert found.first.tolist() == list(expected)
        assert (found.renamed == other_name).all()
    thrice = find_duplicates(joined([base, rows_of(moved, slice(None, None, -1)), base]))
    assert (thrice.first < 14).all()
    assert len(thrice) == 28
    near = replace(base, time_s=base.time_s + 0.01, v1=base.v1 + 0.1)
    assert len(find_duplicates(joined([base, near]))) == 0


def test_duplicates_are_dropped_kept_or_refused(tables):
    parts = [read_source(path) for path in (*tables, tables[0])]
    dropped = merge(parts)
    assert len(dropped.database) == 21
    assert [source.impacts for source in dropped.database.sources] == [14, 7, 0]
    assert_same(dropped.database.impacts, merge(parts[:2]).database.impacts)
    assert len(merge(parts, "keep").database) == 35
    with pytest.raises(InputError, match=r"14 impacts are there twice; the first is gully, a, impact 1 in one\.csv"):
        merge(parts, "refuse")
    with pytest.raises(InputError, match=r"Duplicates cannot be 'sometimes'\. Choose drop, keep, refuse"):
        merge(parts, "sometimes")
    with pytest.raises(InputError, match="no tables"):
        merge([])


def test_conditions_and_groups():
    impacts = joined([bounces(), bounces("quarry", ("c", "d"), seed=5)])
    degrees = np.degrees(impacts.theta1)
    assert matching(impacts, ["theta1_deg<20"]).tolist() == (degrees < 20).tolist()
    assert (
        matching(impacts, ["theta1_deg >= 20", "site = quarry"]).tolist()
        == ((degrees >= 20) & (impacts.site == "quarry")).tolist()
    )
    assert matching(impacts, ["flags=first"]).sum() == 4
    assert matching(impacts, ["flags!=first", "impact<=3"]).sum() == 8
    groups = [("gully", "a"), ("gully", "b"), ("quarry", "c"), ("quarry", "d")]
    for row, (site, trajectory) in zip(group_medians(impacts, ["site", "trajectory"]), groups, strict=True):
        assert (row["site"], row["trajectory"], row["impacts"]) == (site, trajectory, 7)
        rows = (impacts.site == site) & (impacts.trajectory == trajectory)
        for name in ("rn", "r"):
            assert row[f"median_{name}"] == pytest.approx(np.nanmedian(getattr(impacts, name)[rows]), rel=1e-12)
    (first,) = group_medians(rows_of(impacts, [0]), ["site"])
    assert (first["impacts"], first["median_rn"]) == (1, "")


def test_conditions_and_groups_know_the_columns_of_the_graphs():
    """Further columns of numbers, variables, and undefined cells, as where points are coloured and filtered."""
    impacts = bounces()
    hardness = np.round(np.linspace(0.1, 0.9, len(impacts)), 3)
    cells = np.array([*map(str, hardness[:-1]), " "])
    impacts = replace(impacts, extra={"hardness": cells, "ground": np.array(["rock ", "scree"] * 7)})
    known = np.arange(len(impacts)) < len(impacts) - 1
    assert matching(impacts, ["hardness<0.5"]).tolist() == ((hardness < 0.5) & known).tolist()
    assert matching(impacts, ["ground=rock"]).sum() == 7
    slope = np.degrees(np.arccos(impacts.normal[:, 2] / np.linalg.norm(impacts.normal, axis=1)))
    assert matching(impacts, ["slope_deg>=0"]).all()
    assert matching(impacts, [f"slope_deg<{slope.max() + 1}", "doubtful=no", "x_m<1e9"]).all()
    (one, other) = group_medians(impacts, ["ground"])
    assert (one["ground"], one["impacts"], other["ground"]) == ("rock", 7, "scree")
    assert [row["hardness"] for row in group_medians(impacts, ["hardness"])] == [*map(str, hardness[:-1]), ""]


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        ("theta1_deg", "is no condition"),
        ("theta_deg<2", "no column 'theta_deg'. Did you mean theta"),
        ("site<b", "compares texts by size"),
        ("rn<low", "compares numbers with 'low'"),
        ("flags=frist", "asks for no flag"),
    ],
)
def test_bad_conditions_are_refused(condition, message):
    with pytest.raises(InputError, match=message):
        matching(bounces(), [condition])


WRONG = {
    "radians": ({"theta1": np.pi / 180}, "The column theta1_deg is in radians. Multiply it by 57.29578"),
    "km/h part": ({"vn1": 3.6}, "The column vn1_mps is in km/h. Divide it by 3.6"),
    "km/h": ({"v1": 3.6, "v2": 3.6, "vn1": 3.6, "vt1": 3.6, "vn2": 3.6, "vt2": 3.6}, "velocities are in km/h"),
    "mm": ({"position": 1000.0}, "positions are in mm, not m. Divide them by 1000"),
    "feet": ({"position": 1 / 0.3048}, "positions are in feet"),
    "ms": ({"time_s": 1000.0}, "times are in ms, not s"),
    "diameter": ({"diameter_m": 1000.0}, "diameter_m has the median 350: these are no metres"),
    "normal": ({"normal": 2.0}, "has the length 2, not 1"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_units_are_told(case):
    scales, message = WRONG[case]
    impacts = bounces()
    assert check_units(impacts, "t.csv") == []
    with pytest.raises(InputError, match=message):
        check_units(replace(impacts, **{name: getattr(impacts, name) * by for name, by in scales.items()}), "t.csv")


def test_implausible_blocks_are_doubted():
    impacts = bounces()
    assert "density of 2.65 kg/m³" in check_units(replace(impacts, mass_kg=impacts.mass_kg / 1000), "t")[0]


def test_columns_in_other_units_become_ours(tables):
    """Angles in radians, diameters in millimetres, velocities in km/h: the same database as from our units."""
    expected = read_source(tables[0]).impacts
    with tables[0].open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    for name, other, factor in (
        ("v1x_mps", "v1x_kmh", 3.6),
        ("diameter_m", "diameter_mm", 1000.0),
        ("theta1_deg", "theta1_rad", np.pi / 180),
    ):
        for row in rows:
            row[other] = repr(float(row.pop(name)) * factor) if row[name] else row.pop(name)
    with tables[0].open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    assert_same(read_source(tables[0]).impacts, expected)


def test_rows_without_a_site_need_one(tmp_path):
    write_impacts(bounces(""), tmp_path / "t.csv")
    with pytest.raises(InputError, match="names no site"):
        read_source(tmp_path / "t.csv")
    assert set(read_source(tmp_path / "t.csv", site="ravine").impacts.site.tolist()) == {"ravine"}


def test_the_command_merges_filters_and_groups(tables, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["merge", *map(str, tables), str(tables[0]), "--licence", "CC0-1.0", "--group", "site", "--out", str(out)]
    assert main([*argv, "--where", "theta1_deg<30"]) == 0
    said = capsys.readouterr().out
    assert "14 impacts were there twice, 0 of them under another name; they are left out." in said
    assert sorted(path.name for path in out.iterdir()) == [
        "datapackage.json",
        "duplicates.csv",
        "groups.csv",
        "impacts.csv",
    ]
    package = read_package(out)
    assert (np.degrees(package.impacts.theta1) < 30).all()
    with (out / "groups.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["site"] for row in rows] == ["gully", "quarry"]
    here = package.impacts.site == "quarry"
    assert float(rows[1]["median_rt"]) == pytest.approx(np.nanmedian(package.impacts.rt[here]))
    assert main(["merge", str(out), "--out", str(tmp_path / "again")]) == 0
    assert (tmp_path / "again" / "impacts.csv").read_bytes() == (out / "impacts.csv").read_bytes()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--where", "rn<-1"], "No impact is left"),
        (["--group", "sitee"], "There is no column 'sitee'. Did you mean site"),
        (["--licence", "a", "b", "c"], "--licence is given 3 times for 2 tables"),
        (["--where", "v1x_mps"], "is no condition"),
    ],
)
def test_the_command_refuses_and_leaves_nothing(tables, tmp_path, capsys, more, message):
    assert main(["merge", *map(str, tables), "--out", str(tmp_path / "out"), *more]) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
