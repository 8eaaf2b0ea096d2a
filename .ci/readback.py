"""Reads exports by MuJoCo: readback.py POSES.json HAND.urdf ARM.urdf SCENE.xml..."""

import json
import sys
from pathlib import Path

import mujoco
import numpy as np

DIRECTIONS = [(0, 0, -1), (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]
GRAVITY = 9.81
HOLD_S = 2.0
# Compliance of the fingers and the first settling, and what may slide while it is held.
MOVED_MM = 6.0
SLID_MM = 1.0
KINEMATICS = 1e-9


def held(path):
    """Squeezes, turns gravity each way, and returns how far the object moved in all, and in the second half, mm."""
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    key, body = model.key("squeeze").id, model.body("object").id
    moved, slid = [], []
    for direction in DIRECTIONS:
        mujoco.mj_resetDataKeyframe(model, data, key)
        model.opt.gravity[:] = GRAVITY * np.array(direction)
        mujoco.mj_forward(model, data)
        course = [data.xpos[body].copy()]
        steps = round(HOLD_S / model.opt.timestep)
        for _ in range(steps):
            mujoco.mj_step(model, data)
            course.append(data.xpos[body].copy())
        course = 1e3 * np.array(course)
        moved.append(np.linalg.norm(course - course[0], axis=1).max())
        slid.append(np.linalg.norm(course[-1] - course[steps // 2]))
    return moved, slid


def release_falls(path):
    """The same scene with open fingers: the object must fall, or the measure measures nothing."""
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("pregrasp").id)
    mujoco.mj_forward(model, data)
    body = model.body("object").id
    before = data.xpos[body].copy()
    for _ in range(round(0.5 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    fell = 1e3 * (before - data.xpos[body])[2]
    assert fell > 100, f"{path}: with open fingers the object falls {fell} mm"


def kinematics(path, poses):
    """Largest difference of a body's pose from ours, over all poses."""
    # MuJoCo merges bodies without a joint between them, unless the file tells it not to.
    keep = '<mujoco><compiler fusestatic="false"/></mujoco></robot>'
    model = mujoco.MjModel.from_xml_string(Path(path).read_text().replace("</robot>", keep))
    data = mujoco.MjData(model)
    # What the coupled joints repeat, as the URDF says it.
    couplings = {(model.eq_obj1id[e], model.eq_obj2id[e]): model.eq_data[e] for e in range(model.neq)}
    worst = 0.0
    compared = 0
    for pose in poses:
        data.qpos[:] = 0
        for joint, angle in pose["angles"].items():
            data.qpos[model.joint(joint).qposadr[0]] = angle
        for (distal, middle), polynomial in couplings.items():
            at = data.qpos[model.jnt_qposadr[middle]]
            data.qpos[model.jnt_qposadr[distal]] = np.polyval(polynomial[4::-1], at)
        mujoco.mj_kinematics(model, data)
        for name, matrix in pose["bodies"].items():
            body = data.body(name)
            read = np.eye(4)
            read[:3, :3], read[:3, 3] = body.xmat.reshape(3, 3), body.xpos
            worst = max(worst, np.abs(read - np.array(matrix).reshape(4, 4)).max())
            compared += 1
    assert compared >= 1000, compared
    return worst


def main(poses, hand, arm, *scenes):
    poses = json.loads(Path(poses).read_text())
    for path, kind in [(hand, "urdf"), (arm, "urdf-arm")]:
        worst = kinematics(path, poses[kind])
        assert worst < KINEMATICS, f"{kind}: MuJoCo differs by {worst}"
        print(f"readback: {kind} in MuJoCo {mujoco.__version__}: {len(poses[kind])} poses, largest difference {worst:.1e}")
    for path in scenes:
        release_falls(path)
        moved, slid = held(path)
        text = f"moved {max(moved):.2f} mm, of it {max(slid):.2f} mm in the second half"
        print(f"readback: {Path(path).name}: held for {HOLD_S:.0f} s with gravity in six directions, {text}")
        assert max(moved) < MOVED_MM and max(slid) < SLID_MM, f"{path}: moved {np.round(moved, 2)}, slid {np.round(slid, 2)}"


if __name__ == "__main__":
    main(*sys.argv[1:])
