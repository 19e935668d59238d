"""A safety index for SPARK (github.com/intelligent-control-lab/spark) whose rows come from a robot's true links.

SPARK's own indices know spheres around links. This one has their interface (`phi()`, `phi_mask`, `num_constraint`,
`decode_constraint_info()`), so that each of SPARK's safe algorithms takes it, for example with this
configuration:

    safety_index = {"class_name": "ClearanceSafetyIndex", "scene": "scene.yaml", "joints": "g1",
                    "links": ["g1/left_elbow", ...], "obstacles": ["obstacle_0", ...],
                    "min_distance": {"environment": 0.05}, "phi_n": 2, "phi_k": 1}

With phi_k = 0 it is of the first order, for robots that are commanded velocities: phi = dmin - d. Otherwise it is of
the second order, for accelerations: phi = dmin^n - d^n - k d'. The distance d is a certified lower bound, and d' and
the curvature are of the true shapes, with the velocities of obstacles. Needs numpy and Clearance; SPARK imports it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import own_daemon  # noqa: F401  finds the package if it is not installed

import clearance

EPS = 1e-6  # metres: the least distance whose power counts


class ClearanceSafetyIndex:
    """Constraints of each link with each obstacle, the first link first."""

    def __init__(
        self,
        robot_kinematics: Any,
        scene: Any,
        joints: Any,
        links: list[str],
        obstacles: list[str],
        min_distance: dict[str, float],
        phi_n: float = 1.0,
        phi_k: float = 0.0,
        **_: Any,
    ):
        """scene: a scene file, or an Engine or Client. joints: those of the robot's degrees of freedom, in their order.

        links, obstacles: bodies of the scene; the obstacles in the order of task_info["obstacle"].
        """
        self.robot_kinematics, self.robot_cfg = robot_kinematics, robot_kinematics.robot_cfg
        self.num_dof, self.num_state = len(self.robot_cfg.DoFs), self.robot_cfg.num_state
        self.num_control = len(self.robot_cfg.Control)
        self.front = clearance.Engine(clearance.Scene.load(scene)) if isinstance(scene, str) else scene
        self.links, self.obstacles = links, obstacles
        self.num_robot_vol, self.num_obstacle_vol = len(links), len(obstacles)
        self.num_constraint = self.num_constraint_env = len(links) * len(obstacles)
        self.num_constraint_self = 0
        self.phi_mask = np.ones(self.num_constraint, dtype=bool)
        self.dmin = np.full(self.num_constraint, float(min_distance["environment"]))
        self.n, self.k = float(phi_n), float(phi_k)
        fields = ["lower", "gradient_joints", "rate"] + (["curvature"] if self.k else [])
        self.rows = self.front.prepare(
            "distances", joints=joints, bodies=obstacles, fields=fields, signed_distance=True,
            pairs=[(link, obstacle) for link in links for obstacle in obstacles],
        )  # fmt: skip

    def phi(self, x: np.ndarray, task_info: dict[str, Any]) -> tuple[np.ndarray, ...]:
        """Returns phi (C,), Lg (C, controls) and Lf (C, 1), with phi' = Lg u + Lf; and phi0, phi0' (C,) of dmin - d."""
        cfg = self.robot_cfg
        dq = np.asarray(cfg.decompose_state_to_dof_vel(x), dtype=float).reshape(-1)
        d, gradient, rate, curvature = self._distances(x, dq, task_info["obstacle"])
        phi0, phi0dot = self.dmin - d, -rate
        gx = np.asarray(cfg.dynamics_g(x), dtype=float)
        if self.k == 0:  # the velocities are commanded: those of the state count as 0
            return phi0, -gradient @ gx, (gradient @ dq - rate)[:, None], phi0, phi0dot
        fx = np.asarray(cfg.dynamics_f(np.reshape(x, (-1, 1))), dtype=float).reshape(-1)
        far = np.maximum(d, EPS)
        phi = self.dmin**self.n - far**self.n - self.k * rate
        drift = -self.n * far ** (self.n - 1) * rate - self.k * (curvature + gradient @ fx[self.num_dof :])
        return phi, -self.k * gradient @ gx[self.num_dof :], drift[:, None], phi0, phi0dot

    def _distances(self, x: Any, dq: np.ndarray, obstacle: dict[str, Any]) -> tuple[np.ndarray, ...]:
        """Returns lower (C,), gradient_joints (C, dof), rate and curvature (C,).

        Raises RuntimeError, naming a pair, if one of them is not defined.
        """
        q = np.asarray(self.robot_cfg.decompose_state_to_dof_pos(x), dtype=float).reshape(1, -1)
        if obstacle["num"] != self.num_obstacle_vol:
            raise ValueError(f"task_info: expected {self.num_obstacle_vol} obstacles, got {obstacle['num']}")
        poses = np.asarray(obstacle["frames_world"], dtype=float)[None]
        moves = np.zeros((1, self.num_obstacle_vol, 6))
        given = np.asarray(obstacle["velocity"], dtype=float).reshape(self.num_obstacle_vol, -1)  # linear, then angular
        moves[0, :, 3:] = given[:, :3]
        if given.shape[1] == 6:
            moves[0, :, :3] = given[:, 3:]
        r = self.rows.run((q, poses), dq[None], moves)
        if not np.isfinite(r.lower).all():
            raise ValueError("task_info: an obstacle has no usable pose")
        for name in ("gradient_joints", "rate", "curvature")[: 3 if self.k else 2]:
            unusable = ~np.isfinite(getattr(r, name)[0].reshape(self.num_constraint, -1)).all(axis=1)
            if unusable.any():
                i, j = divmod(int(unusable.argmax()), self.num_obstacle_vol)
                raise RuntimeError(
                    f"{self.links[i]} and {self.obstacles[j]} have no {name}: they overlap, or one is a "
                    "surface, solid or cloud"
                )
        curvature = r.curvature[0] if self.k else np.zeros(self.num_constraint)
        return r.lower[0], r.gradient_joints[0], r.rate[0], curvature

    def decode_constraint_info(self, vec: np.ndarray, name: str) -> dict[str, np.ndarray]:
        """Returns numbers of constraints as a matrix of links and obstacles, and an empty one of links."""
        return {
            f"{name}_mat_env": np.reshape(vec, (self.num_robot_vol, self.num_obstacle_vol)),
            f"{name}_mat_self": np.zeros((self.num_robot_vol, self.num_robot_vol)),
        }
