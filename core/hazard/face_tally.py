# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens at each face of the mesh: cliffs and overhangs have no cell of their own in plan."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..simulation.engine import Simulation
from ..simulation.ground import TERRAIN, Ground
from ..vectors import Array, Indices, Names
from .cell_tally import JOULES, UNITS
from .maps import CLASSES_KJ, QUANTITIES, SHARES, Layer
from .quantiles import Sketches
from .tally import Arrays

AT_CONTACT = ("V", "E", "Et")
"""Of `QUANTITIES`, in the order of the kernel."""


def _layers() -> dict[str, Layer]:
    found = {
        "Reach_probability": Layer("Reach probability", "%", "Share of the released blocks that touch the face"),
        "Nr_contacts": Layer("Contacts", "", "Impacts on the face, and stays of blocks that roll or slide on it"),
        "Nr_blocks": Layer("Blocks", "", "How many blocks touch the face at least once"),
    }
    for prefix in AT_CONTACT:
        name, unit, _ = QUANTITIES[prefix]
        for key, words in {
            "mean": "mean", **{f"{share}CI": f"{share} % value" for share in SHARES}, "max": "greatest",
            "95CI_error": "standard error of the 95 % value",
        }.items():  # fmt: skip
            title = f"{name.capitalize()} at the contact, {words}"
            found[f"{prefix}_{key}"] = Layer(title, unit, f"{title}, of all contacts with the face")
    for limit in CLASSES_KJ:
        text = f"Contacts above {limit} kJ"
        found[f"E_over_{limit}kJ"] = Layer(text, "%", f"Share of the contacts with more kinetic energy than {limit} kJ")
    return found


FACE_LAYERS: Mapping[str, Layer] = MappingProxyType(_layers())


@dataclass(frozen=True, eq=False)
class FaceMaps:
    """The maps of n blocks on the triangles that some of them touch.

    Attributes
    ----------
    faces : (t,) their numbers in the ground. corners : (t, 3, 3) local [m].
    of : (t,) "terrain", or the name of a structure.
    blocks : n.
    layers : name, see `FACE_LAYERS` → (t,).
    """

    faces: Indices
    corners: Array
    of: Names
    blocks: int
    layers: Mapping[str, Array]


class FaceTally:
    """Contacts with each face; see `Tally`.

    A contact is an impact, with the speed and energies just before it; or a stay of a block that rolls or slides on the
    face, with the greatest ones of it. One that stays where it has hit is in one contact.

    Parameters
    ----------
    faces : how many elements the ground has: triangles, then points.
    """

    def __init__(self, faces: int) -> None:
        self.faces, self.blocks = faces, 0
        limits = [JOULES * limit for limit in CLASSES_KJ]
        self.contacts = Sketches(faces, UNITS[: len(AT_CONTACT)], column=AT_CONTACT.index("E"), limits=limits)

    def empty(self) -> "FaceTally":
        """One for the same faces to which nothing was added."""
        return FaceTally(self.faces)

    def add(self, simulation: Simulation) -> None:
        """Count the runs of a simulation that recorded all.

        Raises
        ------
        InputError : it did not; the ground has another number of faces.
        """
        from .face_kernels import contacts

        if simulation.recorded != "all":
            raise InputError("Contacts with faces need the whole motion of the blocks", advice="Record all of it")
        if len(simulation.ground.owner) != self.faces:
            raise InputError("The ground has other faces than those that are counted", advice="Take the same terrain")
        records, releases = simulation.records, simulation.releases
        keys, values = np.empty(len(records), np.int32), np.empty((len(records), len(AT_CONTACT)), np.float32)
        mass, inertia = releases.mass_kg, releases.inertia
        count = contacts(
            records.run, records.what, records.face, records.v2, records.omega2, records.v1, records.omega1,
            0.5 * mass, 0.5 * inertia * mass * releases.radius_m**2, np.zeros(self.faces, np.int32), 0, keys, values,
        )  # fmt: skip
        self.contacts.add(keys[:count].copy(), values[:count].copy())
        self.blocks += len(simulation)

    def merge(self, other: "FaceTally") -> None:
        """Count what another one has counted."""
        self.contacts.merge(other.contacts)
        self.blocks += other.blocks

    def arrays(self) -> Arrays:
        """See `Tally`."""
        own = {f"contacts_{name}": values for name, values in self.contacts.arrays().items()}
        return {"faces": np.array([self.faces, self.blocks]), **own}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """See `Tally`."""
        faces, blocks = arrays["faces"].tolist()
        made = cls(faces)
        made.blocks = blocks
        own = {name[9:]: values for name, values in arrays.items() if name.startswith("contacts_")}
        made.contacts = Sketches.from_arrays(own)
        return made

    def maps(self, ground: Ground) -> FaceMaps:
        """The maps of the triangles that blocks touch.

        Parameters
        ----------
        ground : that of the simulations.
        """
        layers, triangles = self.layers(), len(ground.faces)
        faces = np.flatnonzero(layers["Nr_contacts"][:triangles] > 0)
        owner, names = ground.owner[faces], np.array(["terrain", *ground.structures])
        return FaceMaps(
            faces,
            ground.vertices[ground.faces[faces]],
            names[np.where(owner == TERRAIN, 0, owner)],
            self.blocks,
            {name: values[:triangles][faces] for name, values in layers.items()},
        )

    def layers(self) -> dict[str, Array]:
        """All `FACE_LAYERS`: name → (faces,), NaN where no block touches."""
        figures = self.contacts.figures([share / 100 for share in SHARES])

        def layer(values: NDArray[Any]) -> Array:
            filled = np.full(self.faces, np.nan)
            filled[figures.key] = values
            return filled

        layers = {
            "Reach_probability": layer(100.0 * figures.reach / max(self.blocks, 1)),
            "Nr_contacts": layer(figures.count),
            "Nr_blocks": layer(figures.reach),
        }
        for column, prefix in enumerate(AT_CONTACT):
            part = 1.0 / JOULES if QUANTITIES[prefix][1] == "kJ" else 1.0
            layers[f"{prefix}_mean"] = layer(part * figures.mean[:, column])
            for place, share in enumerate(SHARES):
                layers[f"{prefix}_{share}CI"] = layer(part * figures.quantiles[:, column, place])
            layers[f"{prefix}_max"] = layer(part * figures.greatest[:, column])
            layers[f"{prefix}_95CI_error"] = layer(part * figures.error[:, column])
        for place, limit in enumerate(CLASSES_KJ):
            layers[f"E_over_{limit}kJ"] = layer(100.0 * figures.over[:, place] / figures.count)
        return layers
