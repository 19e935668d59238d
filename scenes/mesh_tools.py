"""Small meshes from formulas, written in the formats that Clearance reads. Used by each scene's make_meshes.py; needs numpy.

A part is (name, vertices (V, 3), triangles (T, 3)), triangles counterclockwise seen from outside.
"""

import base64
import json
import math
import struct

import numpy as np


def part(name, vertices, triangles):
    """A part; coordinates are rounded to float32, which every format represents."""
    return name, np.asarray(vertices, np.float32).astype(np.float64), np.asarray(triangles, np.int64)


def moved(p, translation=(0, 0, 0), rotation=None, scale=1.0):
    """The part, scaled, then rotated (3 x 3), then translated."""
    name, v, t = p
    r = np.eye(3) if rotation is None else np.asarray(rotation)
    return part(name, (v * scale) @ r.T + np.asarray(translation, float), t)


def renamed(p, name):
    return name, p[1], p[2]


def rotation(axis, degrees):
    """Rotation about the axis "x", "y" or "z"."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array({"x": [[1, 0, 0], [0, c, -s], [0, s, c]], "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
                     "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis])


def loft(name, rings, closed=False):
    """Rings of n points each, counterclockwise seen from the end of the loft, joined and capped with fans.

    closed: joins the last ring to the first (a torus), without caps.
    """
    rings = [np.asarray(r, float) for r in rings]
    n, v, t = len(rings[0]), [], []
    for r in rings:
        v.extend(r)
    count = len(rings) if closed else len(rings) - 1
    for i in range(count):
        a, b = i * n, (i + 1) % len(rings) * n
        for j in range(n):
            k = (j + 1) % n
            t += [(a + j, a + k, b + k), (a + j, b + k, b + j)]
    if not closed:
        low, high = len(v), len(v) + 1
        v += [rings[0].mean(0), rings[-1].mean(0)]
        top = (len(rings) - 1) * n
        for j in range(n):
            k = (j + 1) % n
            t += [(low, k, j), (high, top + j, top + k)]
    return part(name, v, t)


def circle(radius, z, n, phase=0.0):
    a = 2 * np.pi * (np.arange(n) + phase) / n
    return np.stack([radius * np.cos(a), radius * np.sin(a), np.full(n, float(z))], 1)


def turned(name, profile, n=24):
    """A body of revolution about z from a profile of (radius, z), radius > 0, z from low to high."""
    return loft(name, [circle(r, z, n) for r, z in profile])


def rounded_rectangle(width, depth, radius, z, per_corner=4):
    ring = []
    for corner, (sx, sy) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        for i in range(per_corner):
            a = math.pi / 2 * (corner + i / (per_corner - 1))
            ring.append((sx * (width / 2 - radius) + radius * math.cos(a), sy * (depth / 2 - radius) + radius * math.sin(a), z))
    return np.array(ring)


def extruded(name, outline, low, high):
    """A prism over an outline of (x, y), counterclockwise and star-shaped about its mean."""
    o = np.asarray(outline, float)
    return loft(name, [np.column_stack([o, np.full(len(o), z)]) for z in (low, high)])


def box(name, size, centre=(0, 0, 0)):
    s = np.asarray(size) / 2
    v = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    t = [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)]
    return part(name, np.array(v) * s + np.asarray(centre), t)


def uv_sphere(name, radius, resolution, shape=lambda v: v):
    """Open3D's create_sphere; `shape` deforms its unit sphere before it is scaled."""
    n = resolution
    v = [(0, 0, 1), (0, 0, -1)]
    for i in range(1, n):
        a = math.pi * i / n
        v += [(math.sin(a) * math.cos(math.pi * j / n), math.sin(a) * math.sin(math.pi * j / n), math.cos(a)) for j in range(2 * n)]

    def ring(i):
        return 2 + 2 * n * (i - 1)

    t = []
    for j in range(2 * n):
        k = (j + 1) % (2 * n)
        t += [(0, ring(1) + j, ring(1) + k), (1, ring(n - 1) + k, ring(n - 1) + j)]
        for i in range(1, n - 1):
            t += [(ring(i + 1) + j, ring(i) + k, ring(i) + j), (ring(i + 1) + j, ring(i + 1) + k, ring(i) + k)]
    return part(name, radius * np.array([shape(np.array(p)) for p in v]), t)


def joined(name, parts):
    v, t, base = [], [], 0
    for _, pv, pt in parts:
        v.append(pv)
        t.append(pt + base)
        base += len(pv)
    return part(name, np.concatenate(v), np.concatenate(t))


def number(x):
    """Nine digits, which restore a float32 exactly."""
    return f"{x:.9g}"


def write_obj(path, parts):
    with open(path, "w") as f:
        base = 1
        for name, v, t in parts:
            f.write(f"o {name}\n")
            f.writelines(f"v {' '.join(map(number, p))}\n" for p in v)
            f.writelines(f"f {' '.join(str(i + base) for i in c)}\n" for c in t)
            base += len(v)


def write_off(path, parts):
    _, v, t = joined("", parts)
    with open(path, "w") as f:
        f.write(f"OFF\n{len(v)} {len(t)} 0\n")
        f.writelines(f"{' '.join(map(number, p))}\n" for p in v)
        f.writelines(f"3 {' '.join(map(str, c))}\n" for c in t)


def write_stl(path, parts, text=False):
    """Binary: all parts as one solid. Text: a solid for each part."""
    if text:
        with open(path, "w") as f:
            for name, v, t in parts:
                f.write(f"solid {name}\n")
                for c in t:
                    f.write("facet normal 0 0 0\n outer loop\n")
                    f.writelines(f"  vertex {' '.join(map(number, v[i]))}\n" for i in c)
                    f.write(" endloop\nendfacet\n")
                f.write(f"endsolid {name}\n")
        return
    _, v, t = joined("", parts)
    facets = np.zeros(len(t), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets["corners"] = v[t]
    with open(path, "wb") as f:
        f.write(b"\0" * 80 + struct.pack("<I", len(t)) + facets.tobytes())


def write_ply(path, parts, text=False):
    _, v, t = joined("", parts)
    head = (f"ply\nformat {'ascii' if text else 'binary_little_endian'} 1.0\nelement vertex {len(v)}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {len(t)}\nproperty list uchar int vertex_indices\nend_header\n")
    with open(path, "wb") as f:
        f.write(head.encode())
        if text:
            f.write("".join(f"{' '.join(map(number, p))}\n" for p in v).encode())
            f.write("".join(f"3 {' '.join(map(str, c))}\n" for c in t).encode())
        else:
            f.write(v.astype("<f4").tobytes())
            faces = np.zeros(len(t), dtype=[("n", "u1"), ("corners", "<i4", 3)])
            faces["n"], faces["corners"] = 3, t
            f.write(faces.tobytes())


def write_dae(path, parts, nodes, unit=1.0):
    """nodes: (name of a part, 4 x 4 matrix in the file's unit). A part may occur at several nodes."""
    with open(path, "w") as f:
        f.write('<?xml version="1.0" encoding="utf-8"?>\n<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">\n'
                f'<asset><unit meter="{unit}"/><up_axis>Z_UP</up_axis></asset>\n<library_geometries>\n')
        for name, v, t in parts:
            f.write(f'<geometry id="{name}"><mesh><source id="{name}-p"><float_array id="{name}-a" count="{v.size}">'
                    f'{" ".join(map(number, v.ravel()))}</float_array><technique_common><accessor source="#{name}-a" count="{len(v)}" stride="3">'
                    '<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
                    f'<vertices id="{name}-v"><input semantic="POSITION" source="#{name}-p"/></vertices><triangles count="{len(t)}">'
                    f'<input semantic="VERTEX" source="#{name}-v" offset="0"/><p>{" ".join(map(str, t.ravel()))}</p></triangles></mesh></geometry>\n')
        f.write('</library_geometries>\n<library_visual_scenes><visual_scene id="scene">\n')
        for i, (name, m) in enumerate(nodes):
            f.write(f'<node id="node{i}"><matrix>{" ".join(number(x) for x in np.asarray(m).ravel())}</matrix><instance_geometry url="#{name}"/></node>\n')
        f.write('</visual_scene></library_visual_scenes>\n<scene><instance_visual_scene url="#scene"/></scene>\n</COLLADA>\n')


def gltf(parts, nodes):
    """The JSON (without the buffer's uri) and the buffer. nodes: (name of a part, dict such as {"translation": [x, y, z]})."""
    buffer, views, accessors, meshes = b"", [], [], []
    for name, v, t in parts:
        for data, target in ((v.astype("<f4"), 34962), (t.astype("<u2"), 34963)):
            buffer += b"\0" * (-len(buffer) % 4)
            views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": data.nbytes, "target": target})
            buffer += data.tobytes()
        accessors.append({"bufferView": len(views) - 2, "componentType": 5126, "count": len(v), "type": "VEC3",
                          "min": [float(x) for x in v.min(0)], "max": [float(x) for x in v.max(0)]})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5123, "count": int(t.size), "type": "SCALAR"})
        meshes.append({"name": name, "primitives": [{"attributes": {"POSITION": len(accessors) - 2}, "indices": len(accessors) - 1}]})
    index = {p[0]: i for i, p in enumerate(parts)}
    document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}],
                "nodes": [{"mesh": index[name], **place} for name, place in nodes], "meshes": meshes, "accessors": accessors,
                "bufferViews": views, "buffers": [{"byteLength": len(buffer)}]}
    return document, buffer


def write_gltf(path, parts, nodes):
    document, buffer = gltf(parts, nodes)
    document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    with open(path, "w") as f:
        json.dump(document, f)
        f.write("\n")


def write_glb(path, parts, nodes):
    document, buffer = gltf(parts, nodes)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    buffer += b"\0" * (-len(buffer) % 4)
    with open(path, "wb") as f:
        f.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(buffer)))
        f.write(struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer)
