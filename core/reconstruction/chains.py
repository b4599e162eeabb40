# SPDX-License-Identifier: GPL-3.0-or-later
"""From picks to chains of motion segments: which pick is joined to which."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Indices, Mask
from .picks import Picks


@dataclass(frozen=True, eq=False)
class Segments:
    """k motion segments between consecutive nodes of the chains of n picks.

    Attributes
    ----------
    chain : (n,) number of the pick's chain, counted through all trajectories from 0; -1 for a discarded pick.
    cut_before, cut_after : (n,) the chain is cut there by a shattered or discarded pick of the same trajectory.
    first_pick, last_pick : (k,) the picks at the two ends.
    contact : (k,) the block rolls or slides; otherwise it flies.
    """

    chain: Indices
    cut_before: Mask
    cut_after: Mask
    first_pick: Indices
    last_pick: Indices
    contact: Mask


def find_segments(picks: Picks) -> Segments:
    """Join the picks.

    Notes
    -----
    A *chain* is a run of picks that nothing interrupts. It ends with a `stop`, with a `shattered` pick (the block is
    whole until there, so the flight that arrives is good; the fragments' flight is nobody's), and before a `discarded`
    pick, which belongs to no chain. A `release` starts one.

    The *nodes* of a chain are its picks other than `pass`, and its two ends whatever they are. A *segment* joins two
    consecutive nodes; the passes between them are observations of it. It is *contact* when the block cannot have flown:
    no pass in it or at its ends, and it begins or ends with a `contact` pick or ends with a `stop` (a block comes to
    rest on the ground). To make a flight end in a stop, mark a pass in it. From an impact to its `takeoff` it is
    contact as well. Every other segment is a *flight*.
    """
    n = len(picks)
    discarded, shattered = picks.status == "discarded", picks.status == "shattered"
    stop, passing, rolling = picks.kind == "stop", picks.kind == "pass", picks.kind == "contact"
    leaving = picks.kind == "takeoff"

    starts_group = np.zeros(n + 1, dtype=np.bool_)
    starts_group[picks.group_starts] = True
    starts_group[n] = True

    cut = np.ones(n + 1, dtype=np.bool_)  # before pick i
    cut[1:n] = discarded[1:] | discarded[:-1] | shattered[:-1]
    breaks = cut | starts_group
    breaks[:n] |= picks.kind == "release"
    breaks[1:] |= stop
    inner_cut = cut & ~starts_group

    chain = np.cumsum(breaks[:n] & ~discarded) - 1
    chain[discarded] = -1

    node = (~passing | breaks[:n] | breaks[1:]) & ~discarded
    nodes = np.flatnonzero(node)
    first, last = nodes[:-1], nodes[1:]
    joined = chain[first] == chain[last]
    first, last = first[joined], last[joined]
    direct = (last - first == 1) & ~passing[first] & ~passing[last]
    return Segments(
        chain=chain,
        cut_before=inner_cut[:n],
        cut_after=inner_cut[1:],
        first_pick=first,
        last_pick=last,
        contact=direct & (rolling[first] | rolling[last] | stop[last] | leaving[last]),
    )
