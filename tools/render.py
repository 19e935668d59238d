"""A small software renderer: triangles to a shaded image, with correct visibility and soft shadows. numpy alone.

Lengths are metres, arrays of points (N, 3) in the world frame with z up, images (height, width, 3) float in 0 to 1.
"""
import numpy as np

_BATCH = 64_000  # pixels evaluated together, so that their arrays fit the processor's cache
_EMPTY = np.uint64(0xFFFFFFFFFFFFFFFF)
_DEPTH_STEPS = 2**31


class Camera:
    """A perspective view from `azimuth` and `elevation` (degrees) that fits some points into the image."""

    def __init__(self, points, azimuth, elevation, width, height, margin, field_of_view=28.0):
        azimuth, elevation = np.radians([azimuth, elevation])
        back = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        self.axes = np.stack([right, np.cross(back, right), back])  # rows: right, up, towards the eye
        self.size = np.array([width, height])
        self.focal = height / 2 / np.tan(np.radians(field_of_view) / 2)
        # Nearest eye from which every point is inside the image: each point requires a distance along `back` once the
        # view is centred. Centring is iterated, because it changes with perspective.
        local = points @ self.axes.T
        half = self.size / 2 * (1 - 2 * margin) / self.focal
        centre = (local.min(0) + local.max(0)) / 2
        for _ in range(20):
            distance = np.max(np.abs(local[:, :2] - centre[:2]) / half + local[:, 2:], axis=0).max()
            screen = (local[:, :2] - centre[:2]) / (distance - local[:, 2:])
            centre[:2] += (screen.min(0) + screen.max(0)) / 2 * (distance - centre[2])
        self.eye = np.array([centre[0], centre[1], distance]) @ self.axes

    def project(self, points):
        """(N, 3) world points to (N, 3): x and y in pixels (y down), and the distance in front of the eye."""
        local = (points - self.eye) @ self.axes.T
        depth = -local[:, 2]
        xy = self.focal * local[:, :2] / depth[:, None] * [1, -1] + self.size / 2
        return np.column_stack([xy, depth])

    def rays(self, x, y):
        """(..., 3) directions through the centres of pixels, with length 1 along the view."""
        x, y = np.broadcast_arrays(
            (x + 0.5 - self.size[0] / 2) / self.focal, -(y + 0.5 - self.size[1] / 2) / self.focal
        )
        return np.stack([x, y, -np.ones_like(x)], axis=-1) @ self.axes


def rasterise(screen, triangles, width, height):
    """Returns the frontmost triangle at each pixel.

    screen: (V, 3) x, y in pixels and depth (larger is farther; affine in the image, such as -1/distance).
    Returns (height, width) index of the triangle, -1 for none, and depth.
    """
    low, high = screen[:, 2].min(), screen[:, 2].max()
    scale = (_DEPTH_STEPS - 1) / max(high - low, 1e-300)
    buffer = np.full(width * height, _EMPTY)
    corners = screen[triangles]  # (T, 3, 3)
    first = np.floor(corners[:, :, :2].min(1) - 0.5).astype(int).clip(0)
    last = np.ceil(corners[:, :, :2].max(1) - 0.5).astype(int).clip(None, [width - 1, height - 1])
    extent = (last - first + 1).max(1)
    edge1 = corners[:, 1] - corners[:, 0]
    edge2 = corners[:, 2] - corners[:, 0]
    area = edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0]
    drawable = (last >= first).all(1) & (np.abs(area) > 1e-12)

    # Triangles of similar size on the screen are processed together, as stacks of square tiles.
    for power in range(1, int(np.ceil(np.log2(max(width, height) + 1))) + 1):
        side = 2**power
        chosen = np.flatnonzero(drawable & (extent <= side) & (extent > (side // 2 if power > 1 else 0)))
        rows = max(1, min(side, _BATCH // side))
        step = max(1, _BATCH // (side * rows))
        for begin in range(0, len(chosen), step):
            t = chosen[begin:begin + step]
            for top in range(0, (last[t, 1] - first[t, 1]).max() + 1, rows):
                x = first[t, 0, None, None] + np.arange(side)[None, None, :]
                y = first[t, 1, None, None] + np.arange(top, min(top + rows, side))[None, :, None]
                dx = x + 0.5 - corners[t, 0, 0, None, None]
                dy = y + 0.5 - corners[t, 0, 1, None, None]
                inverse = 1 / area[t, None, None]
                u = (dx * edge2[t, 1, None, None] - dy * edge2[t, 0, None, None]) * inverse
                v = (dy * edge1[t, 0, None, None] - dx * edge1[t, 1, None, None]) * inverse
                inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (x < width) & (y < height)
                n, row, column = np.nonzero(inside)
                depth = corners[t[n], 0, 2] + u[inside] * edge1[t[n], 2] + v[inside] * edge2[t[n], 2]
                key = ((depth - low) * scale).clip(0, _DEPTH_STEPS - 1).astype(np.uint64) << np.uint64(32)
                key |= t[n].astype(np.uint64)
                np.minimum.at(buffer, (first[t[n], 1] + top + row) * width + first[t[n], 0] + column, key)

    index = np.where(buffer == _EMPTY, -1, (buffer & np.uint64(0xFFFFFFFF)).astype(np.int64))
    depth = np.where(buffer == _EMPTY, np.inf, (buffer >> np.uint64(32)).astype(float) / scale + low)
    return index.reshape(height, width), depth.reshape(height, width)


def corner_normals(vertices, triangles, crease=35.0):
    """(T, 3, 3) unit normals: smooth over edges that bend by less than `crease` degrees, sharp elsewhere."""
    corners = vertices[triangles]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = weighted / np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), 1e-300)
    # Vertices at the same place share their normals, whether or not the mesh shares them.
    _, place = np.unique(np.round(vertices / (np.ptp(vertices, axis=0).max() + 1e-300), 7), axis=0, return_inverse=True)
    place = place.reshape(-1)[triangles]
    # A corner's normal is the mean over the adjacent faces with a similar direction. Exact smoothing groups are not
    # worth their cost here.
    order = np.argsort(place.reshape(-1), kind="stable")
    starts = np.flatnonzero(np.r_[True, np.diff(place.reshape(-1)[order]) > 0])
    normals = np.repeat(flat[:, None, :], 3, axis=1).reshape(-1, 3)
    faces = np.repeat(np.arange(len(triangles)), 3)
    limit = np.cos(np.radians(crease))
    counts = np.diff(np.r_[starts, len(order)])
    for count in np.unique(counts):  # corners with the same number of faces are processed together
        rows = order[starts[counts == count][:, None] + np.arange(count)[None, :]]  # (n, count) corners
        if count > 400:  # a pole of a very fine sphere, where the mean of all suffices
            mean = weighted[faces[rows]].sum(1, keepdims=True).repeat(count, axis=1)
        else:
            mean = np.empty(rows.shape + (3,))
            step = max(1, 2_000_000 // count**2)
            for begin in range(0, len(rows), step):
                part = faces[rows[begin:begin + step]]
                alike = np.einsum("nik,njk->nij", flat[part], flat[part]) >= limit
                mean[begin:begin + step] = np.einsum("nij,njk->nik", alike, weighted[part])
        length = np.linalg.norm(mean, axis=2, keepdims=True)
        normals[rows.reshape(-1)] = np.where(length > 0, mean / np.maximum(length, 1e-300), flat[faces[rows]]).reshape(
            -1, 3
        )
    return normals.reshape(-1, 3, 3)


def render(meshes, camera, ground=None, background=(0.965, 0.97, 0.978)):
    """Draws meshes: a list of (vertices (V, 3), triangles (T, 3), colour (3,)).

    ground: height of a floor that receives shadows, or None. The light comes over the viewer's left shoulder.
    Returns the image, (height, width) distance in front of the eye, infinite without a surface, and (height, width)
    index of the visible mesh, -1 for none.
    """
    width, height = camera.size
    offsets = np.cumsum([0] + [len(v) for v, _, _ in meshes])
    vertices = np.concatenate([v for v, _, _ in meshes])
    triangles = np.concatenate([t.astype(np.int64) + o for (_, t, _), o in zip(meshes, offsets)])
    normals = np.concatenate([corner_normals(v, t) for v, t, _ in meshes])
    colours = np.concatenate([np.broadcast_to(np.asarray(c, float), (len(t), 3)) for _, t, c in meshes])
    right, _, back = camera.axes
    light = -0.5 * right + 0.45 * back + [0.0, 0.0, 0.8]
    light /= np.linalg.norm(light)
    background = np.asarray(background, float)

    screen = camera.project(vertices)
    affine = np.column_stack([screen[:, :2], -1 / screen[:, 2]])
    index, inverse = rasterise(affine, triangles, width, height)
    hit = index >= 0
    distance = np.where(hit, -1 / np.where(hit, inverse, -1.0), np.inf)
    image = np.full((height, width, 3), background, dtype=np.float32)
    shadow = _ShadowMap(vertices, triangles, light)

    image[hit] = _shade(camera, vertices, triangles, normals, colours, index, distance, shadow, light)
    if ground is not None:
        image[~hit] *= 1 - _floor_darkness(camera, shadow, ground)[~hit][:, None]
    owners = np.repeat(np.arange(len(meshes)), [len(t) for _, t, _ in meshes])
    return image.clip(0, 1, out=image), distance, np.where(hit, owners[index], -1)


def _shade(camera, vertices, triangles, normals, colours, index, distance, shadow, light):
    """Returns (n, 3) colours of the pixels that show a triangle, row by row."""
    colour = np.empty((np.count_nonzero(index >= 0), 3), np.float32)
    row, column = np.nonzero(index >= 0)
    for begin in range(0, len(colour), _BATCH):
        part = slice(begin, begin + _BATCH)
        y, x = row[part], column[part]
        t = index[y, x]
        rays = camera.rays(x, y)
        positions = camera.eye + rays * distance[y, x][:, None]
        weights = _barycentric(positions, vertices[triangles[t]])
        n = np.einsum("ni,nik->nk", weights, normals[t])
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
        view = -rays / np.linalg.norm(rays, axis=1, keepdims=True)
        n *= np.where(np.einsum("ij,ij->i", n, view) < -0.2, -1.0, 1.0)[:, None]  # inside-out meshes
        lit = shadow.lit(positions + n * shadow.texel * 1.5, spread=1.5)
        diffuse = np.clip(n @ light, 0, 1) * lit
        sky = 0.5 + 0.5 * n[:, 2]
        halfway = light + view
        halfway /= np.linalg.norm(halfway, axis=1, keepdims=True)
        gloss = np.clip(np.einsum("ij,ij->i", n, halfway), 0, 1) ** 40 * lit * 0.10
        rim = (1 - np.clip(np.einsum("ij,ij->i", n, view), 0, 1)) ** 3 * 0.10
        shade = 0.40 + 0.24 * sky + 0.46 * diffuse
        colour[part] = colours[t] * shade[:, None] + (gloss + rim)[:, None]
    return colour


def _floor_darkness(camera, shadow, ground):
    """Returns (height, width) darkness of a floor of which only the shadows are visible, and fade with distance."""
    width, height = camera.size
    # The shadows are soft, so that every fourth pixel of the floor suffices.
    step = 4
    coarse = camera.rays(np.arange(0, width, step)[None, :], np.arange(0, height, step)[:, None])
    along = np.where(coarse[..., 2] < -1e-6, (ground - camera.eye[2]) / np.minimum(coarse[..., 2], -1e-6), np.nan)
    away = np.hypot(camera.eye[0] + coarse[..., 0] * along - shadow.centre[0],
                    camera.eye[1] + coarse[..., 1] * along - shadow.centre[1]) / shadow.radius
    floor = away < 2.6
    occluded = np.zeros(floor.shape)
    occluded[floor] = 1 - shadow.lit(camera.eye + coarse[floor] * along[floor][:, None], spread=16.0)
    darkness = 0.20 * occluded * np.clip(2.6 - np.nan_to_num(away, nan=9.0), 0, 1)
    return darkness.repeat(step, axis=0).repeat(step, axis=1)[:height, :width]


def seen(meshes, camera):
    """(height, width) index of the visible mesh at each pixel, -1 for none; without shading."""
    offsets = np.cumsum([0] + [len(v) for v, _ in meshes])
    screen = camera.project(np.concatenate([v for v, _ in meshes]))
    screen[:, 2] = -1 / screen[:, 2]
    triangles = np.concatenate([t.astype(np.int64) + o for (_, t), o in zip(meshes, offsets)])
    index, _ = rasterise(screen, triangles, *camera.size)
    owners = np.repeat(np.arange(len(meshes)), [len(t) for _, t in meshes])
    return np.where(index >= 0, owners[index], -1)


def shrink(image, factor):
    """Averages factor x factor pixels, which smooths the edges of a larger image."""
    height, width = image.shape[0] // factor, image.shape[1] // factor
    return image[:height * factor, :width * factor].reshape(height, factor, width, factor, -1).mean((1, 3))


def _barycentric(points, corners):
    """(N, 3) weights of the corners (N, 3, 3) at points in (or very near) their triangles."""
    e1, e2, d = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    a, b, c = (np.einsum("ij,ij->i", x, y) for x, y in ((e1, e1), (e1, e2), (e2, e2)))
    p, q = np.einsum("ij,ij->i", d, e1), np.einsum("ij,ij->i", d, e2)
    det = np.maximum(a * c - b * b, 1e-300)
    u, v = (c * p - b * q) / det, (a * q - b * p) / det
    return np.column_stack([1 - u - v, u, v]).clip(0, 1)


class _ShadowMap:
    """Depth from the light's view."""

    SIZE = 1536
    TAPS = 24

    def __init__(self, vertices, triangles, light):
        side = np.cross(light, [0.0, 1.0, 0.0] if abs(light[1]) < 0.9 else [1.0, 0.0, 0.0])
        side /= np.linalg.norm(side)
        self.axes = np.stack([side, np.cross(light, side), -light])
        self.centre = (vertices.min(0) + vertices.max(0)) / 2
        self.radius = np.linalg.norm(vertices - self.centre, axis=1).max()
        self.texel = 2 * self.radius / self.SIZE
        self.index, self.depth = rasterise(self._place(vertices), triangles, self.SIZE, self.SIZE)

    def _place(self, points):
        local = (points - self.centre) @ self.axes.T
        local[:, :2] /= self.texel
        local[:, :2] += self.SIZE / 2
        return local

    def lit(self, points, spread):
        """(N,) share of the light that arrives, softened over about `spread` texels."""
        place = self._place(points).astype(np.float32)
        total = np.zeros(len(points), np.float32)
        for tap in range(self.TAPS):  # sunflower pattern
            radius, angle = spread * np.sqrt((tap + 0.5) / self.TAPS), tap * 2.399963
            x = (place[:, 0] + radius * np.cos(angle)).astype(int).clip(0, self.SIZE - 1)
            y = (place[:, 1] + radius * np.sin(angle)).astype(int).clip(0, self.SIZE - 1)
            total += place[:, 2] <= self.depth[y, x] + 2 * self.texel
        return total / self.TAPS
