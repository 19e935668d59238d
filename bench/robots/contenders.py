"""The contenders of bench_robots.py: the same robot, obstacles and states for each.

verdict: whether each state is free of contact of the robot with obstacles and itself; stops at the first contact.
check: also the pair in contact. bounds: also bounds on its distance.
least: each state's least distance over all pairs in metres, 0 in contact: (lower, upper), equal if the contender has no
bounds.
"""

from typing import Any

import numpy as np

import problems

_BOUNDS = ("lower", "upper")


def tree_of_triangles(coal, vertices, triangles):
    """Coal's model of a mesh. vertices: (N, 3) metres; triangles: (M, 3)."""
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(vertices))
    model.addVertices(np.ascontiguousarray(vertices))
    model.addTriangles(np.ascontiguousarray(triangles.astype(np.int64)))
    model.endModel()
    return model


class PinocchioCoal:
    """Pinocchio's kinematics and Coal's distances, one call in C++ for each state.

    Meshes are their hulls, as in Clearance, or triangles (BVHModelOBBRSS). Every pair starts from its last simplex
    (CachedGuess). A search for the first contact visits pairs in order, each after its boxes, or through a tree of
    boxes; a least distance cannot stop early.
    """

    def __init__(self, resources, joints, robot, as_hulls=True):
        import pinocchio

        import coal

        urdf, srdf = problems.urdf_of(resources, robot)
        self.coal, self.pin, self.joints = coal, pinocchio, joints
        self.model = pinocchio.buildModelFromUrdf(str(urdf))
        self.robot = pinocchio.buildGeomFromUrdf(
            self.model, str(urdf), pinocchio.GeometryType.COLLISION, package_dirs=[str(resources)]
        )
        for item in self.robot.geometryObjects:
            if as_hulls and isinstance(item.geometry, coal.BVHModelBase):  # type: ignore[attr-defined]  # not our folder of that name
                item.geometry.buildConvexHull(True, "Qt")  # buildConvexRepresentation() assumes a convex mesh
                item.geometry = item.geometry.convex
        self.robot.addAllCollisionPairs()
        pinocchio.removeCollisionPairs(self.model, self.robot, str(srdf))
        self.data = self.model.createData()

    def begin(self, problem):
        geometry = self.robot.copy()
        movable = [i for i, item in enumerate(geometry.geometryObjects) if item.parentJoint != 0]
        for thing in problem.obstacles:
            pose = self.pin.XYZQUATToSE3(np.concatenate([thing.pose[:3], thing.pose[4:], thing.pose[3:4]]))
            id = geometry.addGeometryObject(self.pin.GeometryObject(thing.name, 0, pose, self._shape(thing)))
            for i in movable:
                geometry.addCollisionPair(self.pin.CollisionPair(i, id))
        self.geometry, self.geometry_data = geometry, self.pin.GeometryData(geometry)
        for requests in (self.geometry_data.collisionRequests, self.geometry_data.distanceRequests):
            for request in requests:
                request.gjk_initial_guess = self.coal.GJKInitialGuess.CachedGuess
        self.tree = self.pin.TreeBroadPhaseManager_DynamicAABBTreeCollisionManager(
            self.model, self.geometry, self.geometry_data
        )

    def end(self):
        pass

    def _shape(self, thing):
        if thing.shape == "mesh":
            return tree_of_triangles(self.coal, *thing.sizes)
        if thing.shape == "box":
            return self.coal.Box(*thing.sizes)
        if thing.shape == "cylinder":
            return self.coal.Cylinder(thing.sizes[1], thing.sizes[0])
        return self.coal.Sphere(thing.sizes[0])

    def states(self, Q):
        """Pinocchio's positions: a rotating joint without limits is a cosine and a sine."""
        out = np.tile(self.pin.neutral(self.model), (len(Q), 1))
        for k, name in enumerate(self.joints):
            joint = self.model.joints[self.model.getJointId(name)]
            if joint.nq == 2:
                out[:, joint.idx_q], out[:, joint.idx_q + 1] = np.cos(Q[:, k]), np.sin(Q[:, k])
            else:
                out[:, joint.idx_q] = Q[:, k]
        return out

    def ways(self):
        """Functions of states(), by query and by name."""
        return {
            "verdict": {"Coal, pairs in order": self.free, "Coal, tree of boxes": self._free_by_tree},
            "least": {"Coal": self.least},
        }

    def free(self, Q):
        collide, rest = self.pin.computeCollisions, (self.geometry, self.geometry_data)
        return np.array([not collide(self.model, self.data, *rest, q, True) for q in Q])

    def _free_by_tree(self, Q):
        collide = self.pin.computeCollisions
        return np.array([not collide(self.model, self.data, self.tree, q, True) for q in Q])

    def least(self, Q):
        distances, results = self.pin.computeDistances, self.geometry_data.distanceResults
        found = []
        for q in Q:
            least = distances(self.model, self.data, self.geometry, self.geometry_data, q)
            found.append(results[least].min_distance)
        distance = np.maximum(found, 0)
        return distance, distance


QUERIES = {
    "verdict": {"reduce": "any", "fields": "verdict"},
    "check": {"reduce": "any", "fields": ("verdict", "pair")},
    "bounds": {"reduce": "any", "fields": ("lower", "upper", "status", "pair")},
    "least": {"reduce": "min", "fields": _BOUNDS},
}


class Clearance:
    """Clearance: an engine in this process with one thread, or a daemon with one thread over shared memory.

    Obstacles are bodies that are added and removed, as by a planner. Links are hulls, as for the peers, or as selected
    by `mesh_as`.
    """

    def __init__(self, resources, joints, robot, url=None, mesh_as="hull", covers="background"):
        import clearance

        self.clearance, self.robot, self.url, self.mesh_as, self.covers = clearance, robot, url, mesh_as, covers
        self.names = [f"{robot}/{joint}" for joint in joints]
        self.files = problems.files_of(resources, robot)
        self.client = clearance.connect(url) if url else None
        self.current: Any = None
        self.requested: Any = None
        self.scene: Any = None

    def proves(self, q):
        """Returns whether a program without our code finds every pair's bounds at one state proved (in process)."""
        import check_certificate

        document = self.requested.certificate(joints=self.joints, configurations=q[None]).document
        return all(is_proved for is_proved, _ in check_certificate.verdicts(document))

    def begin(self, problem):
        self.current = problem
        if self.client:
            for thing in problem.obstacles:
                self.client.add_body(thing.name, static=True, pose=thing.pose, **shape_of(thing))
            self.requested = self.client
        else:
            self.scene = scene = self.clearance.Scene()
            scene.add_robot(self.robot, mesh_as=self.mesh_as, **self.files)
            for thing in problem.obstacles:
                scene.add_body(thing.name, static=True, pose=thing.pose, **shape_of(thing))
            self.requested = self.clearance.Engine(scene, backend="cpu", threads=1, covers=self.covers)
        self.requested.wait_covers()
        self.joints = self.requested.joints(self.names)

    def end(self):
        if self.client:
            for thing in reversed(self.current.obstacles):
                self.client.remove_body(thing.name)

    def states(self, Q):
        return Q

    def free(self, Q, margin=0.0):
        """(K,) whether each state is free."""
        return np.asarray(self.requested.check(Q, joints=self.joints, margin=margin).free)

    def least(self, Q):
        answer = self.requested.distances(joints=self.joints, configurations=Q, **QUERIES["least"])
        return answer.lower.ravel(), answer.upper.ravel()

    def ways(self):
        """Functions of states(), by query and by name."""
        where = "over shared memory" if self.url else "in process"
        return {
            question: {
                f"Clearance {where}": self._batch(query),
                f"Clearance {where}, prepared, one a call": self._prepared(query),
            }
            for question, query in QUERIES.items()
            if question != "least" or self.covers != "off"  # covers do not change its time
        }

    def _batch(self, query):
        return lambda Q: self.requested.distances(joints=self.joints, configurations=Q, **query)

    def _prepared(self, query):
        def run(Q):
            evaluate = self.requested.prepare("distances", joints=self.joints, **query).run
            for q in Q:
                evaluate(q[None])

        return run


def shape_of(thing):
    """Arguments of add_body() for an obstacle."""
    if thing.shape == "mesh":
        return {"mesh": thing.sizes, "mesh_as": "surface"}
    if thing.shape == "box":
        return {"box": thing.sizes}
    if thing.shape == "cylinder":
        return {"cylinder": (thing.sizes[1], thing.sizes[0])}
    return {"sphere": thing.sizes[0]}


def scene_of(problem, resources, mesh_as="hull", shape=shape_of):
    """A problem's robot with its links according to `mesh_as`, and its obstacles; only the robot moves."""
    import clearance

    scene = clearance.Scene()
    scene.add_robot(problem.robot, mesh_as=mesh_as, static=True, **problems.files_of(resources, problem.robot))
    for thing in problem.obstacles:
        scene.add_body(f"{thing.name}_obstacle", static=True, pose=thing.pose, **shape(thing))
    return scene


def engine_of(problem, resources, mesh_as="hull", covers="background"):
    """An engine with one thread on such a scene."""
    import clearance

    return clearance.Engine(scene_of(problem, resources, mesh_as), backend="cpu", threads=1, covers=covers)
