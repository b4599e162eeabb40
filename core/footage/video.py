# SPDX-License-Identifier: GPL-3.0-or-later
"""What a video file really contains: its frames, each with its own timestamp, and the pictures themselves.

The header's rate and number of frames are only reported. Video time counts from the start of the video stream, as
players show it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..constants import SAME_TIME_S
from ..errors import InputError
from ..formats.mp4 import indexed_frames
from ..opencv import opencv, quiet_opencv
from ..progress import Progress, silent
from ..reading import reader
from ..vectors import Array, Indices
from .containers import codec_name, container_of, holds_sound, lacks_index
from .file_facts import FileFacts, file_facts
from .patched import PatchedFile
from .repeats import ChangeMeter, repeated_pictures
from .sequences import RATE, load_picture, names_sequence, sequence_of

type Image = NDArray[np.uint8]

FRAME_AT_TOLERANCE_S = 1e-5
"""Tables keep times with six decimals."""
MILLISECOND_S = 1e-3
GAP = 1.5
"""A step longer than this many usual steps misses frames."""
LOCAL_STEPS = 31
SAME_RATE = 0.02
"""Steps that differ by less than this, relatively, are of a constant rate."""
FEW_FRAMES = 48
FEWEST_FRAMES, FEW_PIXELS = 4, 8e6
"""Of a file with a whole index, so many of the first frames are decoded, that is `FEW_FRAMES` of small pictures."""
FAR_FRAMES = 40
"""Beyond this many frames a seek is quicker than grabbing on: it goes back 16 frames itself, then to a keyframe."""
MOST_REORDERED = 16
SEEKS = 5
DAMAGED = 30
CONVERT = (
    "Convert it with ffmpeg -i {name} -c:v libx264 -crf 16 -fps_mode passthrough -an {stem}_h264.mp4: "
    "H.264 of constant quality, and the timestamps stay as they are"
)
DEINTERLACE = (
    "Make a frame of each field, which also doubles the rate: ffmpeg -i {name} -vf bwdif=mode=send_field -c:v libx264 "
    "-crf 16 -fps_mode passthrough -an {stem}_fields.mp4"
)


def _none() -> Indices:
    return np.empty(0, np.intp)


@dataclass(frozen=True, eq=False)
class Video:
    """A video of f frames.

    Attributes
    ----------
    path : the file.
    width, height : as displayed, after the rotation [px].
    rotation_deg : clockwise turn that the file asks for, already applied to all pictures: 0, 90, 180 or 270.
    codec, container : readable names.
    header_rate_hz, header_frames : what the file announces, NaN and 0 where it does not; not to be trusted.
    time_s : (f,) timestamps of the frames, in the order of display [s].
    keyframe_s : (k,) timestamps of the frames at which decoding can begin [s]; empty where that is not known.
    pixel_aspect : width / height of a pixel.
    counted : a frame is found by counting from the first, since timestamps are missing or repeated.
    decoded : every frame has been decoded to know this; otherwise those at both ends.
    repeated : (r,) frames that show the picture of the frame before; known only when `decoded`.
    facts : what the file says of itself beside its pictures.
    pictures : the files of a sequence of pictures; empty for a video file.
    bits : of a channel as it is stored; all are read as 8.
    """

    path: Path
    width: int
    height: int
    rotation_deg: int
    codec: str
    container: str
    header_rate_hz: float
    header_frames: int
    time_s: Array
    keyframe_s: Array
    pixel_aspect: float = 1.0
    counted: bool = False
    decoded: bool = False
    repeated: Indices = field(default_factory=_none)
    facts: FileFacts = field(default_factory=FileFacts)
    pictures: tuple[Path, ...] = ()
    bits: int = 8

    @property
    def frames(self) -> int:
        """Number of frames that can be decoded, f."""
        return self.time_s.size

    @property
    def step_s(self) -> Array:
        """(f − 1,) from each frame to the next [s]."""
        return np.diff(self.time_s)

    @property
    def usual_step_s(self) -> float:
        """The median step [s], NaN for a single frame."""
        return float(np.median(self.step_s)) if self.frames > 1 else np.nan

    @property
    def resolution_s(self) -> float:
        """Rounding of the timestamps: a millisecond in Matroska and WebM, 0 where it does not matter [s]."""
        milliseconds = (self.time_s - self.time_s[0]) / MILLISECOND_S
        whole = np.abs(milliseconds - np.round(milliseconds)).max() < 1e-6
        return MILLISECOND_S if whole else 0.0

    @property
    def duration_s(self) -> float:
        """From the first frame to the end of the last [s]."""
        return float(self.time_s[-1] - self.time_s[0]) + (self.usual_step_s if self.frames > 1 else 0.0)

    @property
    def mean_rate_hz(self) -> float:
        """Frames per second over the whole video, gaps included; NaN for a single frame."""
        span = float(self.time_s[-1] - self.time_s[0])
        return (self.frames - 1) / span if span > 0 else np.nan

    @property
    def rate_hz(self) -> float:
        """Frames per second outside the gaps: the rate at which the camera wrote them; NaN for a single frame."""
        steady = self._steady_s
        return 1.0 / float(steady.mean()) if steady.size else np.nan

    @property
    def is_variable(self) -> bool:
        """Whether the steps differ, by more than the rounding of the timestamps and apart from gaps."""
        steady = self._steady_s
        allowed = max(1.01 * self.resolution_s, SAME_RATE * self.usual_step_s)
        return bool(steady.size and np.abs(steady - np.median(steady)).max() > allowed)

    @property
    def gaps(self) -> Indices:
        """(g,) frames after which frames are missing: the next comes later than 1.5 steps that are usual there."""
        return (
            np.flatnonzero(self.step_s > GAP * self._local_step_s + self.resolution_s) if self.frames > 1 else _none()
        )

    @property
    def missing(self) -> Indices:
        """(g,) how many frames would fit into each gap."""
        if self.frames < 2:
            return _none()
        return np.round(self.step_s[self.gaps] / self._local_step_s[self.gaps]).astype(np.intp) - 1

    @property
    def _local_step_s(self) -> Array:
        """(f − 1,) median of the steps around each: phones take fewer frames for a while when it gets dark [s]."""
        from scipy.ndimage import median_filter

        return median_filter(self.step_s, size=LOCAL_STEPS, mode="mirror")

    @property
    def _steady_s(self) -> Array:
        """Steps that are neither gaps nor zero [s]."""
        steady = np.delete(self.step_s, self.gaps)
        return steady[steady > SAME_TIME_S]

    @property
    def duplicates(self) -> Indices:
        """(d,) frames with the timestamp of the frame before."""
        return np.flatnonzero(self.step_s < SAME_TIME_S) + 1


@reader("video")
def open_video(
    path: str | Path, progress: Progress = silent, *, thorough: bool = False, rate_hz: float | None = None
) -> Video:
    """Find the frames of a video file and their timestamps, or the pictures of a sequence.

    The timestamps come from the packets, without decoding, where decoding the first frames finds the same, and those at
    the end as well unless the index of an MP4 or MOV file says that they are there; otherwise, and when `thorough`,
    all frames are decoded.

    Parameters
    ----------
    path : a video file, a folder of numbered pictures, or their name with %d in place of the number.
    thorough : decode every frame, and compare each picture with the one before.
    rate_hz : of a sequence of pictures, which has no times of its own.

    Raises
    ------
    InputError : a file that is missing, no video, cut short before its first frame, in a codec that cannot be decoded,
        without timestamps, or interlaced; a sequence without a rate, or of several sizes; a rate for a video file.
    """
    path = Path(path)
    if names_sequence(path) and not path.is_file():
        return _open_pictures(path, rate_hz, progress, thorough=thorough)
    if rate_hz is not None and path.is_file():
        raise InputError(
            "A video file has its own times, so that no rate can be given to it",
            file=path,
            advice="Leave the rate out; for slow motion give the capture rate",
        )
    _refuse_other_files(path)
    progress(f"Reading the timestamps of {path.name}", 0, 0)
    facts = file_facts(path)
    packet_times, keyframes = _packets(path, facts)
    video, head_s, changing = _begun(path, facts)
    video = replace(video, time_s=packet_times, keyframe_s=keyframes)
    if thorough or not (_is_indexed(video, head_s) or _decodes_as_declared(video)):
        video = _decoded(video, progress)
    if video.frames > 1 and video.time_s[-1] - video.time_s[0] < SAME_TIME_S:
        raise InputError(
            f"The {video.frames} frames of this file have no timestamps",
            file=path,
            advice=f"Tell the true rate with ffmpeg -r RATE -i {path.name} -c copy {path.stem}.mp4",
        )
    if not changing:
        _refuse_still(video)
    return video


def _open_pictures(path: Path, rate_hz: float | None, progress: Progress, *, thorough: bool) -> Video:
    """A sequence of pictures as a video: a number that is missing is a gap in its times."""
    found = sequence_of(path)
    if rate_hz is None:
        raise InputError("A sequence of pictures has no times of its own", file=path, advice=RATE)
    if not (np.isfinite(rate_hz) and rate_hz > 0):
        raise InputError(f"The rate {rate_hz:g} is not above 0", file=path, advice=RATE)
    first = load_picture(found.files[0])
    video = Video(
        path=path,
        width=first.shape[1],
        height=first.shape[0],
        rotation_deg=0,
        codec=found.files[0].suffix[1:].upper().replace("JPG", "JPEG"),
        container="a sequence of pictures",
        header_rate_hz=float(rate_hz),
        header_frames=0,
        time_s=(found.number - found.number[0]) / rate_hz,
        keyframe_s=np.empty(0),
        pictures=found.files,
    )
    if not thorough:
        for _ in _pictures(video, np.unique([0, video.frames // 2, video.frames - 1])):
            pass
        return video
    meter = ChangeMeter()
    for index, picture in _pictures(video, np.arange(video.frames)):
        progress(f"Reading {path.name}", index, video.frames)
        meter.add(picture)
    return replace(video, decoded=True, repeated=repeated_pictures(meter.changes))


def _pictures(video: Video, indices: Indices) -> Iterator[tuple[int, Image]]:
    """Pictures of a sequence.

    Raises
    ------
    InputError : one cannot be read, or has another size.
    """
    for index in indices.tolist():
        picture = load_picture(video.pictures[index])
        _check_size(video, index, picture, video.pictures[index])
        yield index, picture


def _check_size(video: Video, index: int, picture: Image, file: Path) -> None:
    height, width = picture.shape[:2]
    if (width, height) != (video.width, video.height):
        raise InputError(
            f"Frame {index} has {width} × {height} px, and the first has {video.width} × {video.height}",
            file=file,
            advice="Pixels of pictures of several sizes are not those of one camera: use those of one size",
        )


def frame_at(video: Video, time_s: float) -> int:
    """The frame on display at a video time: the last whose timestamp is not after it, 0 before the first."""
    return max(int(np.searchsorted(video.time_s, time_s + FRAME_AT_TOLERANCE_S, side="right")) - 1, 0)


def read_frames(
    video: Video, indices: Sequence[int] | Indices | None = None, *, grey: bool = False
) -> Iterator[tuple[int, Image]]:
    """Pictures as displayed: pairs of the frame's index and (h, w, 3) BGR, or (h, w) when `grey`.

    A picture is known by its timestamp, never by counting from where a seek may have landed.

    Parameters
    ----------
    indices : ascending; None for all frames.

    Raises
    ------
    InputError : indices that are not ascending or beyond the video, a frame that cannot be decoded.
    """
    cv2, wanted = opencv(), _checked(video, indices)
    if video.pictures:
        for index, picture in _pictures(video, wanted):
            yield index, cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if grey else picture
        return
    for index, capture in _grabbed(video, wanted):
        there, picture = capture.retrieve()
        if not there:
            raise _undecodable(video, index)
        _check_size(video, index, picture, video.path)
        yield index, cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if grey else picture


def read_frame(video: Video, index: int, *, grey: bool = False) -> Image:
    """The picture of one frame, (h, w, 3) BGR or (h, w) when `grey`; see `read_frames`."""
    return next(picture for _, picture in read_frames(video, [index], grey=grey))


def _grabbed(video: Video, indices: Indices) -> Iterator[tuple[int, Any]]:
    """The capture, standing at each of the frames in turn."""
    capture, frame = _capture(video.path, video.facts), -1
    for index in indices.tolist():
        if not video.counted and _keyframes_about(video, index)[0] > frame + FAR_FRAMES:
            capture, frame = _seek(video, capture, index)
        while frame < index:
            if not _grab(capture):
                raise _undecodable(video, index)
            frame = frame + 1 if video.counted else _frame_of(video, capture)
        if not video.counted and abs(_time_s(capture) - video.time_s[index]) > SAME_TIME_S:
            raise _undecodable(video, index)
        yield index, capture


def _keyframes_about(video: Video, index: int) -> tuple[int, int]:
    """The last keyframe up to a frame and the next after it; 0 and f where there is none."""
    key = int(np.searchsorted(video.keyframe_s, video.time_s[index] + SAME_TIME_S, side="right"))
    places = np.searchsorted(video.time_s, video.keyframe_s[max(key - 1, 0) : key + 1] - SAME_TIME_S)
    before = int(places[0]) if key > 0 else 0
    return before, int(places[-1]) if key < video.keyframe_s.size else video.frames


def _seek(video: Video, capture: Any, index: int) -> tuple[Any, int]:
    """The capture at a frame up to `index` from which on all pictures are whole, and that frame.

    Notes
    -----
    OpenCV takes the rate for constant and may land anywhere, so the timestamp tells where it did. Where decoding began
    at the keyframe after `index`, the frames shown just before it would be damaged (an open group of pictures);
    there are never more than 16 (H.264 A.3, H.265 A.4).
    """
    cv2 = opencv()
    before, after = _keyframes_about(video, index)
    guess, back = video.time_s[index] * video.header_rate_hz, 1.0
    for _ in range(SEEKS):
        if not guess > back:
            break
        capture.set(cv2.CAP_PROP_POS_FRAMES, int(guess - back))
        late_s = 0.0
        if _grab(capture):
            frame = _frame_of(video, capture)
            if frame <= before or frame <= min(index, after - MOST_REORDERED - 1):
                return capture, frame
            late_s = max(_time_s(capture) - float(video.time_s[index]), 0.0)
        back += MOST_REORDERED + 2 * late_s * video.header_rate_hz
    return _capture(video.path, video.facts), -1


def _frame_of(video: Video, capture: Any) -> int:
    """Index of the frame just grabbed; that of the one before for a timestamp that is not known."""
    return int(np.searchsorted(video.time_s, _time_s(capture) + SAME_TIME_S, side="right")) - 1


def _checked(video: Video, indices: Sequence[int] | Indices | None) -> Indices:
    if indices is None:
        return np.arange(video.frames)
    wanted = np.asarray(indices, np.intp).reshape(-1)
    outside = wanted[(wanted < 0) | (wanted >= video.frames)]
    if outside.size:
        raise InputError(
            f"There is no frame {outside[0]}: the video has the frames 0 to {video.frames - 1}", file=video.path
        )
    if (np.diff(wanted) < 0).any():
        raise InputError("Frames are read in ascending order", file=video.path)
    return wanted


def _begun(path: Path, facts: FileFacts) -> tuple[Video, Array, bool]:
    """The video without its frames, the timestamps of the first few, and whether their pictures differ.

    Raises
    ------
    InputError : there is no picture.
    """
    capture = _capture(path, facts)
    picture: Any = capture.retrieve()[1] if _grab(capture) else None
    if picture is None:
        raise _no_picture(path, facts)
    video = replace(_described(path, capture, picture), facts=facts)
    few = int(np.clip(FEW_PIXELS / (picture.size / 3), FEWEST_FRAMES, FEW_FRAMES))
    times, changing = [_time_s(capture)], False
    while len(times) < few and _grab(capture):
        times.append(_time_s(capture))
        if not changing:
            there, other = capture.retrieve()
            changing = there and not np.array_equal(other, picture)
    return video, np.array(times), changing


def _described(path: Path, capture: Any, picture: Image) -> Video:
    """The video without its frames, as its header and its first picture tell."""
    cv2 = opencv()
    rate, frames = capture.get(cv2.CAP_PROP_FPS), capture.get(cv2.CAP_PROP_FRAME_COUNT)
    across, up = capture.get(cv2.CAP_PROP_SAR_NUM), capture.get(cv2.CAP_PROP_SAR_DEN)
    rotation = round(capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
    aspect = across / up if across > 0 and up > 0 else 1.0
    return Video(
        path=path,
        width=picture.shape[1],
        height=picture.shape[0],
        rotation_deg=rotation,
        codec=codec_name(int(capture.get(cv2.CAP_PROP_FOURCC))),
        container=container_of(path) or path.suffix[1:].upper(),
        header_rate_hz=float(rate) if rate > 0 else np.nan,
        header_frames=int(frames) if frames > 0 else 0,
        time_s=np.empty(0),
        keyframe_s=np.empty(0),
        pixel_aspect=1 / aspect if rotation % 180 else aspect,
        bits=_bits(int(capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT))),
    )


def _bits(pixel_format: int) -> int:
    """Bits of a channel, from FFmpeg's code of a planar format, such as Y3 with 11 and 10 for 10 bits."""
    code = (pixel_format & 0xFFFFFFFF).to_bytes(4, "little")
    if code[:2] in (b"Y3", b"Y1", b"G3") and 8 < code[3] <= 16:
        return code[3]
    return 10 if code[:3] == b"P01" else 8


def _packets(path: Path, facts: FileFacts) -> tuple[Array, Array]:
    """Timestamps of all packets and of those of keyframes, ascending; nothing is decoded."""
    cv2 = opencv()
    capture = _opened(path, facts, [cv2.CAP_PROP_FORMAT, -1])
    times, keys = [], []
    while _grab(capture):
        times.append(_time_s(capture))
        keys.append(capture.get(cv2.CAP_PROP_LRF_HAS_KEY_FRAME) > 0)
    time_s = np.array(times)
    return np.sort(time_s), np.sort(time_s[np.array(keys, bool)])


def _is_indexed(video: Video, head_s: Array) -> bool:
    """Whether the file's index names each of the packets, and the first of them have been decoded at their times."""
    if video.frames == 0 or video.duplicates.size or indexed_frames(video.path) != video.frames:
        return False
    head = video.time_s[: head_s.size]
    return head.size == head_s.size and bool(np.abs(head - head_s).max() <= SAME_TIME_S)


def _decodes_as_declared(video: Video) -> bool:
    """Whether decoding finds the packets' timestamps: of the first frames, and from a late keyframe to the end."""
    if video.frames == 0 or video.duplicates.size:
        return False
    tail = max(video.frames - FEW_FRAMES, 0)
    if (key := _keyframes_about(video, tail)[0]) > 0:  # nearer to it, OpenCV would begin at the keyframe before
        tail = max(tail, min(key + MOST_REORDERED + 2, video.frames - 1))
    try:
        for _ in _grabbed(video, np.arange(min(FEW_FRAMES, tail))):
            pass
        for _, capture in _grabbed(video, np.arange(tail, video.frames)):
            last = capture
    except InputError:
        return False
    return not _grab(last)


def _decoded(video: Video, progress: Progress) -> Video:
    """The frames as decoding them all finds them."""
    capture, meter = _capture(video.path, video.facts), ChangeMeter()
    times: list[float] = []
    while _grab(capture):
        there, picture = capture.retrieve()
        if not there:
            continue
        progress(f"Decoding {video.path.name}", len(times), max(video.frames, len(times)))
        _check_size(video, len(times), picture, video.path)
        meter.add(picture)
        times.append(_time_s(capture))
    time_s, whole = _without_holes(np.array(times))
    if (np.diff(time_s) < -SAME_TIME_S).any():
        raise InputError("The timestamps run backwards", file=video.path, advice=_convert(video.path))
    known = whole and np.isin(_ticks(time_s), _ticks(video.time_s)).all()
    return replace(
        video,
        time_s=time_s,
        keyframe_s=video.keyframe_s if known else np.empty(0),
        counted=not whole or bool((np.diff(time_s) < SAME_TIME_S).any()),
        decoded=True,
        repeated=repeated_pictures(meter.changes),
    )


def _without_holes(time_s: Array) -> tuple[Array, bool]:
    """Timestamps (f,) with those filled in that OpenCV tells as 0 since there are none, and whether all were there.

    AVI files with B-frames lack that of the last frame.
    """
    there = np.r_[True, time_s[1:] != 0.0]
    if there.all() or there.sum() < 2:
        return time_s, bool(there.all())
    frame, known = np.flatnonzero(there), time_s[there]
    filled = np.interp(np.arange(time_s.size), frame, known)
    late = np.arange(frame[-1] + 1, time_s.size)
    filled[late] = known[-1] + (late - frame[-1]) * np.median(np.diff(known))
    return filled, False


def _ticks(time_s: Array) -> NDArray[np.int64]:
    return np.round(time_s / SAME_TIME_S).astype(np.int64)


def _grab(capture: Any) -> bool:
    """Go to the next frame or packet, past a few damaged ones; False at the end."""
    return any(capture.grab() for _ in range(DAMAGED))


def _time_s(capture: Any) -> float:
    """Timestamp of the frame or packet just grabbed, from the start of the stream [s]."""
    return float(capture.get(opencv().CAP_PROP_POS_MSEC)) / 1000


def _capture(path: Path, facts: FileFacts) -> Any:
    """A capture that decodes.

    Raises
    ------
    InputError : the file cannot be opened as a video.
    """
    capture = _opened(path, facts, [])
    if not capture.isOpened():
        _refuse_other_files(path)
        raise _no_picture(path, facts)
    return capture


def _opened(path: Path, facts: FileFacts, settings: list[int]) -> Any:
    """OpenCV's capture, by FFmpeg alone: other backends take a name with digits for a series of pictures."""
    with quiet_opencv() as cv2:
        if facts.hidden:
            return cv2.VideoCapture(PatchedFile(path, facts.hidden), cv2.CAP_FFMPEG, settings)
        return cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, settings)


def _refuse_other_files(path: Path) -> None:
    if not path.is_file():
        raise InputError("There is no such file", file=path, advice="Check the path")
    if path.stat().st_size == 0:
        raise InputError("The file is empty", file=path, advice="Copy it again from the camera")
    container = container_of(path)
    if container.endswith((" picture", " sound")):
        kind, what = container.rsplit(" ", 1)
        raise InputError(f"This is a {what} file ({kind}), not a video", file=path, advice="Give the video itself")


def _no_picture(path: Path, facts: FileFacts) -> InputError:
    """Why no picture of the file can be had."""
    container = container_of(path)
    packets = _opened(path, facts, [opencv().CAP_PROP_FORMAT, -1])
    if packets.isOpened():
        codec = codec_name(int(packets.get(opencv().CAP_PROP_FOURCC)))
        return InputError(
            f"No picture can be decoded: the video is in {codec}, which is damaged or not supported here",
            file=path,
            advice=_convert(path),
        )
    if container in ("MP4", "MOV") and lacks_index(path):
        return InputError(
            "The file is cut short: its index, which comes last, is missing",
            file=path,
            advice="Copy it again from the camera; after a recording that broke off, the program untrunc can often "
            "rebuild it with the help of a whole file of the same camera",
        )
    if container and holds_sound(path):
        return InputError("The file holds sound and no video", file=path, advice="Give the video itself")
    if container:
        return InputError(f"This {container} file holds no video that can be read", file=path, advice=_convert(path))
    return InputError("This is not a video file", file=path, advice="Give an MP4, MOV, MKV, WebM or AVI file")


def _refuse_still(video: Video) -> None:
    """OpenCV 5.0 hands over the same memory for all frames of interlaced video, whatever is in it, without an error."""
    places = np.r_[np.arange(min(4, video.frames)), np.linspace(0, video.frames - 1, 6).astype(np.intp)]
    pictures = (picture for _, picture in read_frames(video, np.unique(places)))
    first = next(pictures)
    if video.frames > 1 and all(np.array_equal(picture, first) for picture in pictures):
        raise InputError(
            "All frames give the same picture, as interlaced video does here",
            file=video.path,
            advice=DEINTERLACE.format(name=video.path.name, stem=video.path.stem),
        )


def _undecodable(video: Video, index: int) -> InputError:
    return InputError(
        f"Frame {index} at {video.time_s[index]:.3f} s cannot be decoded: the file is damaged there",
        file=video.path,
        advice="rockfall inspect tells which frames can be had; copy the file again from the camera",
    )


def _convert(path: Path) -> str:
    return CONVERT.format(name=path.name, stem=path.stem)
