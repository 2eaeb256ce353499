#!/usr/bin/env python3
"""Renders a run: a filmstrip and a small GIF of a robot on its ground.

    python3 scripts/render_walk.py model.xml poses.csv --out out/walk

model.xml  output of `MujocoSim::mjcf`: robot and ground in one MJCF text.
poses.csv  header `t_s,x,y,z,qw,qx,qy,qz`, then one column per joint, named as in the URDF; one row per instant, times increasing.
           Position (m) and orientation of the base in W, joints in rad.

Writes filmstrip.png (a few instants side by side), walk.gif, and with --frames every frame as PNG.

Needs the PyPI packages mujoco==3.17.0, numpy and pillow, and no display: Mesa's software renderer draws through EGL
(Debian: libegl1 libgl1-mesa-dri) or, with MUJOCO_GL=osmesa, without EGL (Debian: libosmesa6).
"""

import argparse
import csv
import os
import pathlib
import sys

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from PIL import Image

BASE_COLUMNS = ["x", "y", "z", "qw", "qx", "qy", "qz"]


def read_poses(path, joint_names):
    """Times (n), base poses (n, 7) and joint positions (n, joints) of a CSV file."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    header, rows = rows[0], rows[1:]
    wanted = ["t_s", *BASE_COLUMNS, *joint_names]
    missing = [name for name in wanted if name not in header]
    if missing or not rows:
        sys.exit(f"{path}: " + (f"no column {', '.join(missing)}" if missing else "no rows below the header"))
    table = np.array(rows, dtype=float)[:, [header.index(name) for name in wanted]]
    return table[:, 0], table[:, 1:8], table[:, 8:]


def dressed(mjcf):
    """The model with sky, a grid on the plane and softer light, for the picture only."""
    spec = mujoco.MjSpec.from_string(mjcf)
    texture = mujoco.mjtTexture
    sky = spec.add_texture(name="sky", type=texture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT)
    sky.rgb1, sky.rgb2, sky.width, sky.height = [0.86, 0.90, 0.95], [0.55, 0.66, 0.80], 64, 384
    grid = spec.add_texture(name="grid", type=texture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER)
    grid.rgb1, grid.rgb2, grid.width, grid.height = [0.66, 0.64, 0.60], [0.58, 0.56, 0.52], 256, 256
    material = spec.add_material(name="grid", texrepeat=[1, 1], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "grid"
    for geom in spec.geoms:
        if geom.name in ("field", "plane"):
            geom.material, geom.rgba = "grid", [1, 1, 1, 1]
        elif geom.type == mujoco.mjtGeom.mjGEOM_BOX:
            geom.rgba = [0.80, 0.42, 0.16, 1]
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.25, 0.25, 0.25]
    spec.visual.quality.shadowsize = 4096
    return spec.compile()


class Film:
    """Poses of one robot, rendered one by one."""

    def __init__(self, model, size, camera, follow):
        self.model, self.data = model, mujoco.MjData(model)
        self.renderer = mujoco.Renderer(model, height=size[1], width=size[0])
        self.camera, self.follow = camera, follow
        joints = [model.joint(i) for i in range(model.njnt) if model.joint(i).type[0] != mujoco.mjtJoint.mjJNT_FREE]
        self.joint_names = [joint.name for joint in joints]
        self.addresses = [joint.qposadr[0] for joint in joints]

    def frame(self, base, q):
        self.data.qpos[:7] = base
        self.data.qpos[self.addresses] = q
        mujoco.mj_forward(self.model, self.data)
        if self.follow:
            # Follows the path over the ground, not the vertical motion of the base.
            self.camera.lookat[:2] = base[:2]
        self.renderer.update_scene(self.data, self.camera)
        return Image.fromarray(self.renderer.render())


def nearest(times, wanted):
    """Index of the row nearest to each wanted time."""
    right = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    return right - (wanted - times[right - 1] < times[right] - wanted)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=pathlib.Path)
    parser.add_argument("poses", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder, made if missing")
    parser.add_argument("--from", dest="start", type=float, help="s, default the first row")
    parser.add_argument("--to", dest="end", type=float, help="s, default the last row")
    parser.add_argument("--fps", type=float, default=12.5, help="frames a second of the GIF")
    parser.add_argument("--size", type=int, nargs=2, default=[480, 270], metavar=("W", "H"), help="pixels of a frame")
    parser.add_argument("--strip", type=int, default=5, help="instants of the filmstrip")
    parser.add_argument("--colors", type=int, default=48, help="colours of the GIF")
    parser.add_argument("--follow", action="store_true", help="keep the robot in the middle; a fixed camera makes a smaller GIF")
    parser.add_argument("--distance", type=float, default=2.6, help="distance from the camera to its target, m")
    parser.add_argument("--azimuth", type=float, default=125.0, help="degrees, 90 = looks along +y")
    parser.add_argument("--elevation", type=float, default=-18.0, help="degrees, negative = from above")
    parser.add_argument("--frames", action="store_true", help="keep every frame as PNG")
    args = parser.parse_args()

    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = args.distance, args.azimuth, args.elevation
    camera.lookat[2] = 0.35
    film = Film(dressed(args.model.read_text()), args.size, camera, args.follow)
    times, bases, joints = read_poses(args.poses, film.joint_names)
    start = times[0] if args.start is None else args.start
    end = times[-1] if args.end is None else args.end
    shown = bases[(times >= start) & (times <= end)]
    if len(shown) == 0:
        sys.exit(f"{args.poses}: no row between {start} s and {end} s, the rows go from {times[0]} s to {times[-1]} s")
    camera.lookat[:2] = (shown[:, :2].min(axis=0) + shown[:, :2].max(axis=0)) / 2
    args.out.mkdir(parents=True, exist_ok=True)

    def render(wanted):
        return [film.frame(bases[row], joints[row]) for row in nearest(times, wanted)]

    instants = render(np.linspace(start, end, args.strip))
    strip = Image.new("RGB", (args.size[0] * args.strip, args.size[1]))
    for place, image in enumerate(instants):
        strip.paste(image, (place * args.size[0], 0))
    strip.save(args.out / "filmstrip.png", optimize=True)

    frames = render(np.arange(start, end, 1.0 / args.fps))
    # One palette for all frames: colours do not flicker, and pixels equal to those of the frame before take no space.
    palette = strip.quantize(args.colors)
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    duration_ms = 1000.0 / args.fps
    small[0].save(args.out / "walk.gif", save_all=True, append_images=small[1:], duration=duration_ms, loop=0, optimize=True)
    if args.frames:
        for number, frame in enumerate(frames):
            frame.save(args.out / f"frame_{number:05}.png")
    print(f"{args.out}: filmstrip.png, walk.gif with {len(frames)} frames")


if __name__ == "__main__":
    main()
