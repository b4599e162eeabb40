# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts with faces: a wall that has no cell, a slide from face to face, and the records themselves."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.face_tally import FACE_LAYERS, FaceTally
from rockfall.core.simulation.engine import IMPACT, Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.terrain.surface import Surface

G = 9.81
SETTINGS = Settings("azimi_desvarreux_1977", {"rn": 0.4, "rt": 0.9}, rolling="coulomb", friction=0.0, gravity_mps2=G)


def ground(corners: list[tuple[float, float, float]]) -> Ground:
    faces = np.arange(len(corners)).reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return make_ground(Surface(np.array(corners, np.float64), faces.astype(np.int32), GlobalShift(), "faces"))


def test_blocks_thrown_at_a_wall() -> None:
    n, speed = 300, 12.0
    floor = [(0, 0, 0), (40, 0, 0), (40, 20, 0), (0, 20, 0)]
    wall = [(30, 0, -5), (30, 20, -5), (30, 20, 40), (30, 0, 40)]
    site = ground([*floor, *wall])
    places = np.column_stack([np.full(n, 20.0), np.linspace(1, 19, n), np.full(n, 20.0)])
    releases = make_releases(places, velocity=np.tile([speed, 0.0, 0.0], (n, 1)), diameter_m=1.0)
    simulation = simulate(site, releases, SETTINGS)
    tally = FaceTally(len(site.owner))
    tally.add(simulation)
    layers = tally.layers()
    t = (10 - 0.5) / speed
    hit = np.hypot(speed, G * t)
    below = np.nansum(layers["Nr_contacts"][2:])
    assert below >= n
    assert np.nansum(layers["Reach_probability"][2:]) >= 100
    assert np.nanmax(layers["V_max"][2:]) == pytest.approx(hit, rel=1e-6)
    energy = 0.5 * releases.mass_kg[0] * hit**2 / 1000
    assert np.nanmax(layers["Et_max"][2:]) == pytest.approx(energy, rel=1e-6)
    assert np.nanmax(layers["Et_99CI"][2:]) == pytest.approx(energy, rel=0.01)
    assert set(layers) == set(FACE_LAYERS)


def test_a_slide_touches_each_face_once_on_its_way() -> None:
    slope = 0.5
    strips = [
        corner
        for k in range(6)
        for corner in [(5 * k, 0, -5 * slope * k), (5 * k + 5, 0, -slope * (5 * k + 5)),
                       (5 * k + 5, 10, -slope * (5 * k + 5)), (5 * k, 10, -5 * slope * k)]
    ]  # fmt: skip
    surface = ground(strips).surface
    vertices, faces = np.unique(surface.vertices, axis=0, return_inverse=True)
    site = make_ground(Surface(vertices, faces.reshape(-1)[surface.faces].astype(np.int32), GlobalShift(), "strips"))
    radius, x = 0.3, 1.0
    z = -slope * x + radius * np.hypot(1, slope)
    simulation = simulate(site, make_releases(np.array([[x, 5.0, z]]), diameter_m=2 * radius), SETTINGS)
    tally = FaceTally(len(site.owner))
    tally.add(simulation)
    layers = tally.layers()
    touched = np.flatnonzero(layers["Nr_blocks"] == 1)
    assert touched.size >= 6
    assert (layers["Nr_contacts"][touched] == 1).all(), "a stay is one contact"
    lowest = site.surface.vertices[site.surface.faces[touched]][:, :, 0].max(axis=1)
    bound = np.sqrt(2 * G * slope * (lowest - x + 1.0))
    assert (layers["V_max"][touched] <= bound).all()


def test_every_impact_is_a_contact_in_any_order_of_merging() -> None:
    line = np.arange(40.0)
    x, y = np.meshgrid(line, line)
    i = np.arange(1600).reshape(40, 40)
    faces = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    z = -0.8 * x + 0.2 * np.sin(x) * np.cos(y)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    site = make_ground(Surface(vertices, faces.astype(np.int32), GlobalShift(), "slope"))
    places = np.column_stack([np.full(60, 2.0), np.linspace(10, 30, 60), np.full(60, 1.0)])
    simulation = simulate(site, make_releases(places, diameter_m=0.4), Settings("noel_2017", rolling="none"))
    whole, merged = FaceTally(len(site.owner)), FaceTally(len(site.owner))
    whole.add(simulation)
    for start, stop in ((40, 60), (0, 40)):
        part = merged.empty()
        part.add(simulation.part(start, stop))
        merged.merge(FaceTally.from_arrays(part.arrays()))
    assert {name: a.tobytes() for name, a in whole.arrays().items()} == {
        name: a.tobytes() for name, a in merged.arrays().items()
    }
    records = simulation.records
    hits = np.bincount(records.face[records.what == IMPACT], minlength=len(site.owner))
    np.testing.assert_array_equal(np.nan_to_num(whole.layers()["Nr_contacts"]), hits)


def test_another_ground_is_refused() -> None:
    site = ground([(0, 0, 0), (40, 0, 0), (40, 20, 0), (0, 20, 0)])
    simulation = simulate(site, make_releases(np.array([[5.0, 5.0, 2.0]])), SETTINGS)
    with pytest.raises(InputError, match="other faces"):
        FaceTally(7).add(simulation)
