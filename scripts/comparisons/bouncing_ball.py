# SPDX-License-Identifier: GPL-3.0-or-later
"""A filmed ball from video to R_N: with a camera of assumed focal length, against parabolas in the picture.

Gravity gives every flight its distance. What the focal length and the camera's pitch, which nobody measured, do to R_N
is shown by varying them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from rockfall.core.camera.model import look_at, rays
from rockfall.core.camera.path import fixed
from rockfall.core.footage.background import no_motion
from rockfall.core.footage.kinks import Kinks, find_kinks
from rockfall.core.footage.tracking import track_block
from rockfall.core.footage.video import open_video
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import Refinement, refine
from rockfall.core.reconstruction.refinement.views import PixelObservations, View
from rockfall.core.vectors import Array

VIDEO = Path(__file__).parents[2] / "assets" / "examples" / "bouncing_ball" / "balle1-vp9.avi"
RATE_HZ = 187.35
CLICK = (60, 147.0, 48.0)
FIRST = 4
"""Before it the ball is still a streak at the edge of the hand."""
WIDTH, HEIGHT = 320, 240
FIELD_DEG = 55.0
"""Horizontal angle of view that is assumed: a usual small camera."""
FOCAL_PX = WIDTH / 2 / np.tan(np.radians(FIELD_DEG / 2))
DRAWS = 1000
"""Of R_N for each camera, for the interval over all of them."""
SCALE_PXPM = 225.0
"""A rough scale, only to start from."""
BALL = Block(0.07, 0.07, 0.07, 400.0)
GRAVITY_MPS2 = 9.81
LEVEL_DEG = 1e-3
CLEAR_S = 0.012
"""Sightings as close to an impact are left out of the parabolas: the ball is on the bench."""


@dataclass(frozen=True, eq=False)
class Ball:
    """The tracked ball: times (m,) [s], pixels (m, 2), standard deviations (m,), and its kinks."""

    time_s: Array
    pixel: Array
    sigma_px: Array
    kinks: Kinks


def followed() -> Ball:
    """The ball from one click."""
    video = open_video(VIDEO)
    still = no_motion(0, video.frames - 1)
    track = track_block(video, CLICK[0], CLICK[1:], background=still)
    rows = track.frame >= FIRST
    time, pixel, sigma = track.frame[rows] / RATE_HZ, track.pixel[rows], track.sigma_px[rows]
    return Ball(time, pixel, sigma, find_kinks(time, pixel, sigma))


def filmed(
    ball: Ball,
    focal_px: float = FOCAL_PX,
    *,
    sigma_pitch_deg: float = LEVEL_DEG,
    sigma_roll_deg: float = LEVEL_DEG,
    free: Sequence[str] = (),
) -> Refinement:
    """Refine three flights and two impacts on a level bench, seen by a camera that looks along y."""
    camera = look_at(WIDTH, HEIGHT, [0, 0, 0], [0, 1, 0], focal_px=focal_px)
    time = np.r_[ball.time_s[0] - 0.5 / RATE_HZ, ball.kinks.time_s, ball.time_s[-1] + 0.5 / RATE_HZ]
    pixel = np.concatenate([ball.pixel[:1], ball.kinks.pixel, ball.pixel[-1:]])
    origin, direction = rays(camera, pixel)
    picks = make_picks(
        ["ball"] * 4,
        time,
        origin + direction * (focal_px / SCALE_PXPM / direction[:, 1])[:, None],
        kind=["pass", "impact", "impact", "pass"],
        normal=np.tile([0.0, 0.0, 1.0], (4, 1)),
        sigma_time_s=np.r_[1e-4, 3 * ball.kinks.sigma_time_s, 1e-4],
    )
    m = ball.time_s.size
    seen = PixelObservations(np.zeros(m, dtype=np.intp), np.full(m, "ball"), ball.time_s, ball.pixel, ball.sigma_px)
    held = 1e-10
    turns = np.radians([sigma_pitch_deg, LEVEL_DEG, sigma_roll_deg]) ** 2
    view = View("video", fixed(camera), pose_covariance=np.diag([*turns, held, held, held]))
    drag = Drag(coefficient=0.45) if "drag" in free else None
    return refine(picks, [view], seen, block=BALL, gravity_mps2=GRAVITY_MPS2, drag=drag, free=free, sigma_aim=0.0)


def pitch_deg(found: Refinement) -> float:
    """How far the camera looks up."""
    return float(np.degrees(np.arcsin(found.views[0].path.reference.rotation[2, 2])))


def parabolas(ball: Ball) -> tuple[Array, Array, Array]:
    """R_N (2,) of one scale for all, and (2,) of each flight's own scale by g; root mean squares (3,) [px].

    The flights are parabolas in the picture, as the usual software has them.
    """
    edges = np.r_[-np.inf, ball.kinks.time_s, np.inf]
    fits, off = [], []
    for start, end in pairwise(edges):
        rows = (ball.time_s > start + CLEAR_S) & (ball.time_s < end - CLEAR_S)
        fits.append(np.polyfit(ball.time_s[rows], ball.pixel[rows, 1], 2, w=1 / ball.sigma_px[rows]))
        off.append(np.std(ball.pixel[rows, 1] - np.polyval(fits[-1], ball.time_s[rows])))
    one, own = [], []
    for i, guess in enumerate(ball.kinks.time_s):
        meet = np.roots(fits[i + 1] - fits[i])
        time = meet[np.argmin(np.abs(meet - guess))]
        before, after = (np.polyval(np.polyder(fits[j]), time) for j in (i, i + 1))
        one.append(-after / before)
        own.append(one[-1] * fits[i][0] / fits[i + 1][0])
    return np.array(one), np.array(own), np.array(off)


def main() -> None:
    """Print the comparison."""
    ball = followed()
    print(
        f"{ball.time_s.size} sightings to ± {np.median(ball.sigma_px):.2f} px, kinks at {ball.kinks.time_s.round(4)} s"
    )
    one, own, off = parabolas(ball)
    print(
        f"parabolas in the picture, residual {off.round(2)} px: R_N {own.round(3)} by the g of each, "
        f"{one.round(3)} with one scale"
    )
    drawn, rng = [], np.random.default_rng(0)
    for label, options in (
        ("level", {}),
        ("pitch free", {"sigma_pitch_deg": 15.0, "free": ("camera",)}),
        ("pitch, roll free", {"sigma_pitch_deg": 15.0, "sigma_roll_deg": 3.0, "free": ("camera",)}),
        ("pitch, roll, drag", {"sigma_pitch_deg": 15.0, "sigma_roll_deg": 3.0, "free": ("camera", "drag")}),
    ):
        print(f"camera {label}:")
        for factor in (0.5, 1.0, 1.5, 2.0):
            found = filmed(ball, factor * FOCAL_PX, **options)  # type: ignore[arg-type]
            impacts, place = found.reconstruction.impacts, found.picks.position
            depth = place[:, 1]
            drawn.append(rng.normal(impacts.rn, impacts.sigma["rn"], (DRAWS, len(impacts))))
            values = ", ".join(f"{v:.3f} ± {s:.3f}" for v, s in zip(impacts.rn, impacts.sigma["rn"], strict=True))
            print(
                f"  f x {factor:g}: R_N {values}; {found.rmse_px:.2f} px, noise x {found.noise_scale:.1f}, pitch "
                f"{pitch_deg(found):+.1f}°, {depth[0]:.2f} to {depth[-1]:.2f} m away, scale "
                f"{factor * FOCAL_PX / depth[0]:.0f} to {factor * FOCAL_PX / depth[-1]:.0f} px/m, second impact "
                f"{100 * (place[2, 2] - place[1, 2]):+.1f} cm higher, times {impacts.time_s.round(4)}"
            )
    low, middle, high = np.percentile(np.concatenate(drawn), (2.5, 50, 97.5), axis=0)
    ends = ", ".join(f"{m:.2f} ({a:.2f} to {b:.2f})" for a, m, b in zip(low, middle, high, strict=True))
    print(f"whatever of these the camera is: R_N {ends}, 95 %")


if __name__ == "__main__":
    main()
