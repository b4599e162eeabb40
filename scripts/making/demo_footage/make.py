# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the demo site's footage, ``assets/demo/footage``: one block filmed by hand, ground control, and the truth.

Run ``python scripts/making/demo_footage/make.py`` in the environment of this checkout (Blender as a module).
Rendering takes a quarter of an hour on two cores; frames are kept in ``--frames``, and ``--resume`` goes on from them.
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from making.demo_footage import rendering, scene, shot, sight, tables
from making.demo_site.make import SEED, SHIFT

OUT = Path(__file__).resolve().parents[3] / "assets" / "demo" / "footage"


def main() -> None:
    """Render what is missing, encode it, measure in it what a person would, and write the truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--frames", type=Path, default=Path("footage_frames"), help="folder for the rendered frames")
    parser.add_argument("--resume", action="store_true", help="keep the frames that are there")
    parser.add_argument("--tables-only", action="store_true", help="measure in the film that is there")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    options.frames.mkdir(parents=True, exist_ok=True)
    take = shot.shot(SEED, SHIFT)
    tree = sight.terrain_tree(take)
    targets = sight.choose_targets(take, tree)
    path = options.out / "footage.mp4"
    if not options.tables_only:
        render(take, targets, options.frames, options.resume)
        rendering.encode(options.frames.resolve(), path.resolve())
    tables.write(take, tree, targets, path, SHIFT)


def render(take: shot.Shot, targets: scene.Array, folder: Path, resume: bool) -> None:
    """All frames, and first the still that they are painted with."""
    stage = scene.build(take, targets)
    worst = rendering.check_projection(stage, take, targets)
    print(f"Projection differs from Blender's by {worst:.4f} px at most")
    if worst > 0.01:
        raise RuntimeError("The truth's projection is not that of the pictures")
    still = folder.resolve() / "still.png"
    if not (resume and still.exists()):
        rendering.render_still(stage, take, folder.resolve() / "unfinished.png")
        (folder / "unfinished.png").rename(still)
    rendering.paint(stage, take, still)
    pixels = tables.block_pixels(take)
    started = time.perf_counter()
    for frame in range(shot.FRAMES):
        path = folder.resolve() / f"{frame:04d}.png"
        if not (resume and path.exists()):
            rendering.render_frame(stage, frame, path, pixels[frame])
        if frame % 25 == 24:
            print(f"{frame + 1} frames, {time.perf_counter() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
