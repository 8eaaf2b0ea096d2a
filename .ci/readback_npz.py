"""Reads exported arrays by NumPy: readback_npz.py PLAN.json HAND.urdf ONE.npz ALL.npz."""

import json
import sys
from pathlib import Path

import mujoco
import numpy as np

# Of single precision, on lengths below a metre and angles below a turn.
TOLERANCE = 1e-6


def pose(of):
    """Position and quaternion, its real part first."""
    return np.array([*of["position"], *of["orientation_wxyz"]])


def postures(path):
    arrays = np.load(path, allow_pickle=False)
    return {key: arrays[key] for key in arrays.files}


def main(plan, hand, one, all_grasps):
    plan = json.loads(Path(plan).read_text())
    model = mujoco.MjModel.from_xml_path(hand)
    one, every = postures(one), postures(all_grasps)
    names = [name.decode() for name in one["joint_names"]]
    known = {model.joint(j).name for j in range(model.njnt)}
    assert set(names) == known, f"joints {set(names) ^ known}"
    assert one["obj_path"].item().decode() == plan["object"]["source"]
    assert np.abs(one["obj_pose"] - pose(plan["object"]["base_from_object"])).max() < TOLERANCE
    width = 7 + len(names)
    for number, grasp in enumerate(plan["grasps"]):
        sites = {"approach": "approach_site", "pregrasp": "grasp_site", "grasp": "grasp_site", "lift": "lift_site"}
        angles = {"approach": "pregrasp", "pregrasp": "pregrasp", "grasp": "grasp"}
        for key, site in sites.items():
            row = every[f"{key}_qpos"][number]
            assert row.shape == (width,) and row.dtype == np.float32, (key, row.shape, row.dtype)
            assert np.abs(row[:7] - pose(grasp[site])).max() < TOLERANCE, key
            if key in angles:
                # A distal joint repeats its middle one, and has no entry of its own in a plan.
                should = np.array([grasp[angles[key]][name.replace("_distal", "_middle")] for name in names])
                assert np.abs(row[7:] - should).max() < TOLERANCE, key
        squeeze, touch = every["squeeze_qpos"][number], every["grasp_qpos"][number]
        # The same palm, and fingers that press.
        assert (squeeze[:7] == touch[:7]).all() and np.abs(squeeze[7:] - touch[7:]).max() > 0.01
        assert every["epsilon"][number] == grasp["quality"]["epsilon"]
    for key, row in one.items():
        rows = every[key]
        assert (row == (rows[0] if rows.ndim > row.ndim else rows)).all(), key
    print(f"readback: {len(plan['grasps'])} grasps of {len(names)} joints in NumPy {np.__version__}")


if __name__ == "__main__":
    main(*sys.argv[1:])
