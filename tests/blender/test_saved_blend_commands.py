# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that are given a saved .blend: another Blender writes what it holds, and the numbers are the project's."""

import csv
import tempfile
from pathlib import Path

import bpy
import numpy as np
import pytest

SPEEDS = ("v1x_mps", "v1y_mps", "v1z_mps", "v2x_mps", "v2y_mps", "v2z_mps")


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def numbers(file: Path, names: tuple[str, ...]) -> np.ndarray:
    return np.array([[float(row[name] or "nan") for name in names] for row in rows(file)])


@pytest.fixture
def demo(part) -> Path:
    return Path(part("core").__file__).parents[1] / "assets" / "demo"


def saved(part, project: Path, file: Path) -> Path:
    part("rockfall_addon.scene.project").load_project(bpy.context.scene, project)
    bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=True)
    return file


def test_a_saved_blend_gives_the_impacts_of_its_project(rockfall, part, demo: Path, tmp_path: Path) -> None:
    """Blender holds corners of the terrain in single precision about its shift: here to 8 µm."""
    run = part("rockfall_addon.commands").run
    blend = saved(part, demo / "project.toml", tmp_path / "site.blend")
    for source, out in ((blend, "blend"), (demo / "project.toml", "project")):
        assert run(["reconstruct", str(source), "--out", str(tmp_path / out)]) == 0
    ours, theirs = (numbers(tmp_path / out / "impacts.csv", SPEEDS) for out in ("blend", "project"))
    assert len(ours) == 104
    np.testing.assert_allclose(ours, theirs, atol=1e-4)
    normals = [numbers(tmp_path / out / "impacts.csv", ("nx", "ny", "nz", "rn")) for out in ("blend", "project")]
    np.testing.assert_allclose(*normals, atol=1e-3)


def test_a_refined_blend_is_a_project_that_stands_alone(
    rockfall, part, demo: Path, tmp_path: Path, monkeypatch
) -> None:
    """Terrain, camera and track that the .blend held lie beside the refined project, and it can be read again."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    run = part("rockfall_addon.commands").run
    blend = saved(part, demo / "footage" / "project.toml", tmp_path / "film.blend")
    assert run(["refine", str(blend), "--out", str(tmp_path / "refined")]) == 0
    assert list(temporary.iterdir()) == []
    blend.unlink()
    refined = tmp_path / "refined" / "project.toml"
    project = part("core.exchange.project").read_project(refined)
    assert all(file.is_file() for file in (project.videos[0].file, project.videos[0].camera, project.videos[0].track))
    assert run(["motion", str(refined), "--tables-only", "--out", str(tmp_path / "m")]) == 0
    assert len(rows(tmp_path / "m" / "track_residuals.csv")) > 200


def test_a_damaged_blend_is_named_as_it_was_typed(rockfall, part, tmp_path: Path, capsys) -> None:
    (tmp_path / "cut.blend").write_bytes(b"BLENDER17-01v0502" + bytes(2000))
    assert (
        part("rockfall_addon.commands").run(["motion", str(tmp_path / "cut.blend"), "--out", str(tmp_path / "o")]) == 1
    )
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith(f"rockfall: {tmp_path / 'cut.blend'}: Blender cannot open this")
    assert said.count("cut.blend") == 2 or "Save it again" in said
    assert not (tmp_path / "o").exists()
