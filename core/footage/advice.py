# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the footage is good enough: frames per turn of the block, and what one frame and one pixel span."""

from math import pi, sqrt

import numpy as np

from ..vectors import Array, Indices, Mask
from .background import BackgroundMotion, layers_px
from .file_facts import FileFacts, chapters_remark, streams_remark
from .repeats import picture_rate, repeat_sigma_s, repeats_sentence, rhythm
from .video import Video

FRAMES_PER_TURN = 5.0
"""To follow a block's rotation (Noël et al. 2018)."""
REPEAT_TOUCHES = 2
"""Frames on either side of a single repeated picture whose times may be wrong."""
LOWEST_RATE_HZ = 30.0
"""For rockfalls in general (Noël et al. 2018)."""
TELEVISION = 0.998
"""29.97 frames a second are the 30 of television."""
OTHER_CAPTURE_RATE = 0.02
"""A capture rate that is nearer to that of the file, relatively, is the same."""


def rolling_turns_hz(speed_mps: float, radius_m: float) -> float:
    """Turns per second of a block that rolls without sliding, ω = v / r."""
    return speed_mps / (2 * pi * radius_m)


def time_sigma_s(rate_hz: float) -> float:
    """Standard deviation of a moment that is known to one frame: uniform over 1 / rate [s]."""
    return 1 / (rate_hz * sqrt(12))


def with_repeats(sigma_s: Array, time_s: Array, video: Video, repeated: Indices) -> Array:
    """(n,) standard deviations of times (n,) [s], of those that pictures shown twice touch widened.

    Notes
    -----
    Pictures that are repeated in a rhythm are those of a conversion, after which no time is right; single ones are of a
    camera that was late, which touches the times beside them.
    """
    if not repeated.size:
        return sigma_s
    step = video.usual_step_s
    touched: Mask = np.ones(time_s.size, np.bool_)
    if not any(rhythm(repeated)):
        late = video.time_s[repeated]
        touched = np.asarray((np.abs(time_s[:, None] - late) <= REPEAT_TOUCHES * step).any(axis=1))
    return np.where(touched, np.hypot(sigma_s, repeat_sigma_s(step)), sigma_s)


def proposed_capture_rate(facts: FileFacts, rate_hz: float) -> float | None:
    """The capture rate [Hz] that a file names, where it is not that at which it plays; None where it names none."""
    named = facts.capture_rate_hz
    differs = np.isfinite(named) and rate_hz > 0 and abs(named / rate_hz - 1) > OTHER_CAPTURE_RATE
    return named if differs else None


def capture_rate_sentence(facts: FileFacts, rate_hz: float, how: str) -> str:
    """That a file names another capture rate, and `how` it is taken over, a sentence; empty where it names none."""
    named = proposed_capture_rate(facts, rate_hz)
    if named is None:
        return ""
    times = named / rate_hz
    kind = f"{times:.4g} times slower than life" if times > 1 else f"{1 / times:.4g} times faster than life"
    return (
        f"By {facts.capture_rate_name} of the file {named:.5g} pictures a second were taken, and it plays "
        f"{rate_hz:.5g}: it would be {kind}. {how}"
    )


def pixel_size_m(distance_m: float, focal_px: float) -> float:
    """What one pixel spans across the line of sight at a distance [m]."""
    return distance_m / focal_px


def turn_advice(rate_hz: float, turns_hz: float, spinning: str = "A block") -> str:
    """Whether the turns can be counted at a capture rate, a sentence; `spinning` is its subject."""
    needed = max(FRAMES_PER_TURN * turns_hz, LOWEST_RATE_HZ)
    least = (
        f"{needed:.0f} frames a second are needed to count turns"
        if FRAMES_PER_TURN * turns_hz >= LOWEST_RATE_HZ
        else f"{LOWEST_RATE_HZ:.0f} frames a second are the least to film at"
    )
    enough = "" if rate_hz < needed * TELEVISION else ", which is enough"
    return f"{spinning} turns {turns_hz:.1f} times a second: {least}, this video has {rate_hz:.4g}{enough}."


def uncountable(rate_hz: float, speed_mps: float, radius_m: float) -> str:
    """That a block at this speed turns too fast to be counted when it rolls, a sentence; empty where it does not."""
    turns = rolling_turns_hz(speed_mps, radius_m)
    if not rate_hz < FRAMES_PER_TURN * turns * TELEVISION:
        return ""
    return turn_advice(rate_hz, turns, f"At {speed_mps:.3g} m/s a rolling block of {2 * radius_m:.3g} m diameter")


def rate_advice(
    video: Video,
    *,
    capture_rate_hz: float | None = None,
    speed_mps: float | None = None,
    radius_m: float | None = None,
    spin_radps: float | None = None,
) -> list[str]:
    """Advice on the frame rate, sentences.

    Parameters
    ----------
    capture_rate_hz : of the camera; None for the rate of the file.
    speed_mps, radius_m : the fastest speed and the radius of the block; together they tell the spin of rolling.
    spin_radps : the fastest spin, where it is known.
    """
    stored = capture_rate_hz or video.rate_hz
    if not np.isfinite(stored):
        return ["One frame is no film: nothing can be timed with it."]
    rate = picture_rate(video.repeated, video.frames, stored)
    sigma_s = time_sigma_s(rate)
    if video.repeated.size:
        sigma_s = float(np.hypot(sigma_s, repeat_sigma_s(1 / stored)))
    sentences = []
    if spin_radps is not None:
        sentences.append(turn_advice(rate, abs(spin_radps) / (2 * pi)))
    elif speed_mps is not None and radius_m is not None:
        spinning = f"At {speed_mps:.3g} m/s a rolling block of {2 * radius_m:.3g} m diameter"
        sentences.append(turn_advice(rate, rolling_turns_hz(speed_mps, radius_m), spinning))
    else:
        sentences.append(
            f"At {rate:.4g} frames a second turns can be counted up to {rate / FRAMES_PER_TURN:.3g} a second "
            f"({FRAMES_PER_TURN:.0f} frames per turn, Noël et al. 2018)."
        )
        if rate < LOWEST_RATE_HZ * TELEVISION:
            sentences.append(f"Rockfalls are better filmed at {LOWEST_RATE_HZ:.0f} frames a second or more.")
    sentences.append(
        f"An impact marked on its frame is known to ± {1000 * sigma_s:.1f} ms "
        + ("(one picture / √12, and the repeated ones)" if video.repeated.size else "(one frame / √12)")
        + (f", in which the block moves {speed_mps * sigma_s:.2g} m." if speed_mps is not None else ".")
    )
    return sentences


def content_advice(video: Video) -> list[str]:
    """What is wrong with the file itself, sentences; empty when nothing is."""
    sentences = [text for text in (streams_remark(video.facts), chapters_remark(video.path)) if text]
    if video.header_frames > video.frames:
        sentences.append(
            f"By its header the file should have {video.header_frames} frames, and {video.frames} can be decoded: "
            "time is not to be told by counting frames."
        )
    if video.is_variable:
        sentences.append("The frame rate varies: frame number / rate is not the time, the timestamps are.")
    if video.gaps.size:
        lost = int(video.missing.sum())
        sentences.append(
            f"{lost} frame{'s are' if lost > 1 else ' is'} missing in {video.gaps.size} "
            f"gap{'s' if video.gaps.size > 1 else ''}: an impact within a gap is not seen."
        )
    if video.duplicates.size:
        sentences.append(f"{video.duplicates.size} frames have the timestamp of the frame before.")
    if video.repeated.size:
        sentences.append(repeats_sentence(video.repeated, video.frames, video.rate_hz))
    if uneven_pixels(video.pixel_aspect):
        sentences.append(
            f"Pixels are {video.pixel_aspect:.3f} times as wide as high: solve the camera with fx and fy apart "
            "(align --free fx,fy)."
        )
    if video.bits > 8:
        sentences.append(f"The pictures have {video.bits} bits, reduced to 8 here. Places and times are not touched.")
    return [*sentences, *video.facts.remarks]


def uneven_pixels(aspect: float) -> bool:
    """Whether pixels are not square: width / height differs from 1."""
    return abs(aspect - 1) > 1e-3


def layered_background(motion: BackgroundMotion, width: int) -> str:
    """That the background does not move as one in pictures of this width, and what follows; empty where it does."""
    found = layers_px(motion, width)
    if found is None:
        return ""
    return (
        f"Parts of the background move differently, by {found[0]:.1f} px about frame {found[1]}: near and far ground "
        "before a camera that was moved, or a lens that distorts. The pixels of the track are as they are seen, but "
        "impacts proposed from it may be off; look at each."
    )
