# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks: from a video's own timestamps to the time that all videos and picks share."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, overload

import numpy as np

from ..errors import InputError
from ..remarks import Remark
from ..vectors import Array, Indices
from .video import Video

LEAST_SIGMA_S = 0.005
"""No event is taken to be timed better than this when none says how well: half a frame at 100 frames per second."""
WRONG_SIGMAS = 5.0
MAD_TO_SIGMA = 1.4826
DRIFT_NEEDS = 3
WORST_SIGMA_DRIFT = 0.01
LIKELY_DRIFT = 0.005
"""Clocks of cameras run within 100 parts in a million; more than half a per cent has another cause."""


@dataclass(frozen=True)
class Clock:
    """Common time = offset_s + (1 + drift) · rate · (video time − origin_s), the video time with its gaps.

    Attributes
    ----------
    offset_s : common time at `origin_s` [s].
    drift : how much more common time passes than the video's clock says, relative (1e-5 = 36 ms in an hour).
    origin_s : video time about which the drift turns [s].
    rate : file rate / capture rate: 1/8 for 240 pictures a second stored at 30.
    gaps : where the file's times are not those of the frames: the video time of the last frame before, and by how much
        all later ones are late [s of the video]; below zero where frames are doubled. In time order.

    Raises
    ------
    InputError : a clock that stands still or runs backwards.
    """

    offset_s: float = 0.0
    drift: float = 0.0
    origin_s: float = 0.0
    rate: float = 1.0
    gaps: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.numbers).all() and self.rate > 0 and self.drift > -1):
            raise InputError(
                f"This clock does not run: offset {self.offset_s:g} s, drift {self.drift:g}, "
                f"origin {self.origin_s:g} s, rate {self.rate:g}",
                advice="All must be finite, the rate above 0 and the drift above -1",
            )

    @property
    def speed(self) -> float:
        """Common seconds per second of video time."""
        return (1 + self.drift) * self.rate

    @overload
    def to_common(self, video_s: float) -> float: ...
    @overload
    def to_common(self, video_s: Array) -> Array: ...
    def to_common(self, video_s: Any) -> Any:
        """Common time of video times [s]."""
        return self.offset_s + self.speed * (self.filmed(video_s) - self.origin_s)

    @overload
    def to_video(self, common_s: float) -> float: ...
    @overload
    def to_video(self, common_s: Array) -> Array: ...
    def to_video(self, common_s: Any) -> Any:
        """Video time of common times [s]."""
        video_s = self.origin_s + (common_s - self.offset_s) / self.speed
        for at, lost in self.gaps:  # in a gap it is the frame before; what doubled frames show twice is the first time
            after = video_s > at + max(lost, 0.0)
            video_s = np.where(after, video_s - lost, np.minimum(video_s, at) if lost > 0 else video_s)
        return float(video_s) if self.gaps and np.ndim(common_s) == 0 else video_s

    @overload
    def filmed(self, video_s: float) -> float: ...
    @overload
    def filmed(self, video_s: Array) -> Array: ...
    def filmed(self, video_s: Any) -> Any:
        """Video times as they would be without the gaps [s]."""
        if not self.gaps:
            return video_s
        late = sum(np.where(np.asarray(video_s) > at, lost, 0.0) for at, lost in self.gaps)
        return float(video_s + late) if np.ndim(video_s) == 0 else video_s + late

    @property
    def numbers(self) -> list[float]:
        """All of it as a list: offset, drift, origin, rate, and both numbers of each gap."""
        return [self.offset_s, self.drift, self.origin_s, self.rate, *(value for gap in self.gaps for value in gap)]

    @classmethod
    def of_numbers(cls, numbers: Iterable[float]) -> "Clock":
        """The clock of such a list."""
        offset_s, drift, origin_s, rate, *gaps = (float(value) for value in numbers)
        return cls(offset_s, drift, origin_s, rate, tuple(zip(gaps[::2], gaps[1::2], strict=True)))

    def with_gap(self, at_s: float, lost_s: float) -> "Clock":
        """With a further gap; one at the same frame is changed by as much."""
        known = dict(self.gaps)
        known[at_s] = known.get(at_s, 0.0) + lost_s
        return replace(self, gaps=tuple(sorted(known.items())))


@dataclass(frozen=True, eq=False)
class Synchronisation:
    """A clock fitted to n events seen in the video and on the common time.

    Attributes
    ----------
    clock : its origin is the mean time of the events.
    residual_s : (n,) common time of the event − that of the clock [s].
    sigma_offset_s : standard deviation of the clock at its origin [s], NaN for one event of unknown accuracy.
    sigma_drift : that of the drift, 0 when it was not fitted.
    suspects : (k,) events that do not agree with the others.
    remarks : what to look at.
    """

    clock: Clock
    residual_s: Array
    sigma_offset_s: float
    sigma_drift: float
    suspects: Indices
    remarks: tuple[Remark, ...] = ()


def clock_for(
    video: Video,
    capture_rate_hz: float | None = None,
    *,
    offset_s: float = 0.0,
    drift: float = 0.0,
    origin_s: float = 0.0,
) -> Clock:
    """The clock of a video that was taken at `capture_rate_hz` (None: at the rate of the file).

    Raises
    ------
    InputError : a capture rate that is not above 0; a video of a single frame, whose rate is not known.
    """
    if capture_rate_hz is None:
        return Clock(offset_s, drift, origin_s)
    if not (np.isfinite(capture_rate_hz) and capture_rate_hz > 0):
        raise InputError(f"The capture rate {capture_rate_hz:g} is not above 0", file=video.path)
    if not video.rate_hz > 0:
        raise InputError("A single frame has no rate", file=video.path, advice="Leave out the capture rate")
    return Clock(offset_s, drift, origin_s, video.rate_hz / capture_rate_hz)


def synchronise(
    reference_common_s: Any,
    video_s: Any,
    *,
    rate: float = 1.0,
    fit_drift: bool = False,
    sigma_s: Any = None,
    names: Sequence[str] | None = None,
) -> Synchronisation:
    """The clock of a video, from n events whose common times are known: weighted least squares.

    Parameters
    ----------
    reference_common_s, video_s : (n,) common and video times of the same events [s].
    rate : file rate / capture rate.
    fit_drift : whether to fit the drift too, from three events on.
    sigma_s : (n,) or one, standard deviation of common time − clock [s]; None: told by the scatter.
    names : (n,) of the events, for the remarks; None: their numbers, from 1 on.

    Raises
    ------
    InputError : no event, lengths that differ, times that are not finite; for the drift, fewer than three events, or
        events so close together that it would be known worse than to 1 %.

    Notes
    -----
    Known sigmas are enlarged when the residuals scatter more than they say (chi-squared per degree of freedom > 1).
    """
    reference, seen, sigma = _events(reference_common_s, video_s, sigma_s)
    if fit_drift and seen.size < DRIFT_NEEDS:
        raise InputError(
            f"A drift needs at least {DRIFT_NEEDS} events, there are {seen.size}", advice="Mark more, or fit no drift"
        )
    weight = 1 / sigma**2
    origin = float(weight @ seen / weight.sum())
    ran = rate * (seen - origin)
    offset = float(weight @ (reference - ran) / weight.sum())
    drift, spread = 0.0, float(weight @ ran**2)
    if fit_drift:
        drift = float(weight @ ((reference - offset - ran) * ran)) / spread if spread > 0 else np.nan
    residual = reference - offset - (1 + drift) * ran
    scale = _scale(residual, sigma, 2 if fit_drift else 1, known=sigma_s is not None)
    sigma_drift = float(scale / np.sqrt(spread)) if fit_drift and spread > 0 else 0.0
    least = max(sigma_drift, float(1 / np.sqrt(spread)) if spread > 0 else np.inf)
    if fit_drift and least > WORST_SIGMA_DRIFT:
        raise InputError(
            f"The events lie within {np.ptp(ran):.3g} s, too close together to tell a drift (± {100 * least:.2g} %)",
            advice="Mark events near both ends of the video, or fit no drift",
        )
    off = _disagreement(reference, rate * seen, fit_drift)
    suspects = _suspects(off, sigma)
    return Synchronisation(
        clock=Clock(offset, drift, origin, rate),
        residual_s=residual,
        sigma_offset_s=float(scale / np.sqrt(weight.sum())),
        sigma_drift=sigma_drift,
        suspects=suspects,
        remarks=tuple(_remarks(off, sigma, suspects, drift, names or [str(i + 1) for i in range(seen.size)])),
    )


def _events(reference: Any, seen: Any, sigma: Any) -> tuple[Array, Array, Array]:
    common = np.asarray(reference, np.float64).reshape(-1)
    video = np.asarray(seen, np.float64).reshape(-1)
    if common.size != video.size:
        raise InputError(f"{common.size} common times and {video.size} video times do not match")
    if common.size == 0:
        raise InputError(
            "There is no event to synchronise with", advice="Mark one that both see, such as an impact or a clap"
        )
    if not (np.isfinite(common).all() and np.isfinite(video).all()):
        event = int(np.flatnonzero(~(np.isfinite(common) & np.isfinite(video)))[0])
        raise InputError(f"Event {event + 1} has no time", advice="Leave it out")
    allowed = np.broadcast_to(np.asarray(LEAST_SIGMA_S if sigma is None else sigma, np.float64), common.shape)
    if not (np.isfinite(allowed).all() and (allowed > 0).all()):
        raise InputError("The standard deviation of an event is not above 0", advice="Leave sigma_s out to estimate it")
    return common, video, allowed


def _scale(residual: Array, sigma: Array, fitted: int, *, known: bool) -> float:
    """By how much the residuals scatter more than sigma; NaN when nothing tells."""
    freedom = residual.size - fitted
    if freedom == 0:
        return 1.0 if known else np.nan
    scatter = float(np.sqrt(np.sum((residual / sigma) ** 2) / freedom))
    return max(scatter, 1.0) if known else scatter


def _disagreement(reference: Array, ran: Array, with_drift: bool) -> Array:
    """How far each event is from what most agree on: the median offset, or the line of Theil (1950) and Sen (1968)."""
    off = reference - ran
    if with_drift and reference.size > 3:
        i, j = np.triu_indices(reference.size, 1)
        apart = np.abs(ran[j] - ran[i]) > 0
        off = off - np.median((off[j] - off[i])[apart] / (ran[j] - ran[i])[apart]) * ran
    return off - np.median(off)


def _suspects(off: Array, sigma: Array) -> Indices:
    """Events far off the others, by the median absolute deviation or their own sigma."""
    if off.size < 3:
        return np.empty(0, np.intp)
    usual = np.maximum(MAD_TO_SIGMA * float(np.median(np.abs(off))), sigma)
    return np.flatnonzero(np.abs(off) > WRONG_SIGMAS * usual)


def _remarks(off: Array, sigma: Array, suspects: Indices, drift: float, names: Sequence[str]) -> Iterator[Remark]:
    far = off - np.median(np.delete(off, suspects))
    for event in suspects:
        text = f"Event {names[event]} is {far[event]:+.3f} s off the others: look at it again or leave it out."
        yield Remark(text, "warning", f"event {names[event]}")
    if off.size == 2 and abs(off[1] - off[0]) > WRONG_SIGMAS * np.hypot(*sigma):
        text = f"The two events disagree by {off[1] - off[0]:+.3f} s: a third would tell which of them is wrong."
        yield Remark(text, "warning", "events")
    if abs(drift) > LIKELY_DRIFT and not suspects.size:
        text = (
            f"A drift of {100 * drift:+.2f} % is more than clocks do: the capture rate is probably another one, "
            f"{1 / (1 + drift):.4g} times as high."
        )
        yield Remark(text, "warning", "drift")
