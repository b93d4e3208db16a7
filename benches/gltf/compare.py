#!/usr/bin/env python3
"""glTF scenes against Cycles: makes them, renders them with both programs, and compares means of blocks of 16 x 16 pixels.

    python3 -m venv V && V/bin/pip install bpy mitsuba numpy     (Python of the version that bpy asks for)
    cargo build --release
    V/bin/python benches/gltf/compare.py target/release/croupier [FOLDER [SCENE...]]

FOLDER gets scenes and pictures. bpy is Blender as a module, and mitsuba is only asked to read EXR. Cycles renders with a
box filter, without clamping, filter glossy, denoising or limits that shorten paths. For each scene it prints the ratio
croupier / Cycles of the picture's mean, and of blocks that are not nearly black: lowest, quartiles, highest, and what noise
of both would make of ratios that are 1. With all scenes the table goes to benches/results/gltf.md as well.

Scenes, all lit by an emissive square: `instances` has diffuse meshes in 40 nested, scaled, sheared and mirrored nodes;
`metal_rough` a base colour and a metallic-roughness texture; `normals` a normal map besides; `mask` leaves of alphaMode MASK.

What differs by design: the two mix and filter textures before and after decoding sRGB; their dielectrics differ by a few
per cent at grazing angles; and where a normal map turns the surface away from the light (or coarse meshes do with normals
of vertices), Cycles darkens what croupier folds back without a loss of energy.
"""
import base64
import json
import math
import random
import struct
import subprocess
import sys
import zlib
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path

SIZE = (320, 240)
BLOCK = 16
SAMPLES = 64


def png(width, height, texel):
    """8-bit RGBA; `texel(x, y)` with y down."""
    rows = b"".join(b"\0" + bytes(v for x in range(width) for v in texel(x, y)) for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class Asset:
    """A glTF document that grows."""

    def __init__(self):
        self.bytes = b""
        self.json = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [], "materials": [],
            "accessors": [], "bufferViews": [], "images": [], "textures": [], "cameras": [],
            "extensionsUsed": ["KHR_materials_specular", "KHR_materials_emissive_strength"],
        }

    def push(self, name, value):
        self.json[name].append(value)
        return len(self.json[name]) - 1

    def view(self, data):
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)}
        self.bytes += data
        return self.push("bufferViews", view)

    def floats(self, rows):
        flat = [x for row in rows for x in row]
        kind = {2: "VEC2", 3: "VEC3"}[len(rows[0])]
        accessor = {"bufferView": self.view(struct.pack(f"<{len(flat)}f", *flat)), "componentType": 5126,
                    "count": len(rows), "type": kind}
        accessor["min"] = [min(c) for c in zip(*rows)]
        accessor["max"] = [max(c) for c in zip(*rows)]
        return self.push("accessors", accessor)

    def mesh(self, points, normals, uvs, triangles, material):
        flat = [i for t in triangles for i in t]
        indices = self.push("accessors", {"bufferView": self.view(struct.pack(f"<{len(flat)}I", *flat)),
                                          "componentType": 5125, "count": len(flat), "type": "SCALAR"})
        attributes = {"POSITION": self.floats(points), "NORMAL": self.floats(normals), "TEXCOORD_0": self.floats(uvs)}
        return self.push("meshes", {"primitives": [{"attributes": attributes, "indices": indices, "material": material}]})

    def texture(self, width, height, texel):
        view = self.view(png(width, height, texel))
        image = self.push("images", {"bufferView": view, "mimeType": "image/png"})
        return self.push("textures", {"source": image})

    def diffuse(self, rgb):
        return self.push("materials", {
            "pbrMetallicRoughness": {"baseColorFactor": [*rgb, 1], "metallicFactor": 0, "roughnessFactor": 1},
            "extensions": {"KHR_materials_specular": {"specularFactor": 0}}, "doubleSided": True})

    def node(self, parent=None, **node):
        index = self.push("nodes", node)
        siblings = self.json["scenes"][0]["nodes"] if parent is None else self.json["nodes"][parent].setdefault("children", [])
        siblings.append(index)
        return index

    def square(self, material, half, parent=None, **node):
        """In the plane y = 0, facing up."""
        points = [(-half, 0, -half), (-half, 0, half), (half, 0, half), (half, 0, -half)]
        uvs = [(0, 0), (0, 1), (1, 1), (1, 0)]
        mesh = self.mesh(points, [(0, 1, 0)] * 4, uvs, [(0, 1, 2), (0, 2, 3)], material)
        return self.node(parent, mesh=mesh, **node)

    def sphere(self, material, columns=48, rows=24):
        points, uvs, triangles = [], [], []
        for j in range(rows + 1):
            for i in range(columns + 1):
                a, b = 2 * math.pi * i / columns, math.pi * j / rows
                points.append((math.sin(b) * math.cos(a), math.cos(b), math.sin(b) * math.sin(a)))
                uvs.append((1 - i / columns, j / rows))
        for j in range(rows):
            for i in range(columns):
                p, q = j * (columns + 1) + i, (j + 1) * (columns + 1) + i
                triangles += [t for t, keep in (((p, p + 1, q), j > 0), ((q, p + 1, q + 1), j < rows - 1)) if keep]
        return self.mesh(points, points, uvs, triangles, material)

    def room(self):
        """Floor, light, camera."""
        self.square(self.diffuse((0.6, 0.55, 0.5)), 4)
        light = self.push("materials", {
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
            "emissiveFactor": [1, 0.9, 0.8], "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 12}, "KHR_materials_specular": {"specularFactor": 0}}})
        # turned over: it shines down
        self.square(light, 0.8, translation=[0.5, 4, 0.5], rotation=[1, 0, 0, 0])
        camera = self.push("cameras", {"type": "perspective", "perspective": {
            "yfov": math.radians(36), "aspectRatio": SIZE[0] / SIZE[1], "znear": 0.01}})
        tilt = math.radians(-22) / 2
        self.node(camera=camera, translation=[0, 2.9, 5.6], rotation=[math.sin(tilt), 0, 0, math.cos(tilt)])

    def write(self, path):
        document = {k: v for k, v in self.json.items() if v != []}
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()
        document["buffers"] = [{"byteLength": len(self.bytes), "uri": uri}]
        path.write_text(json.dumps(document))


def instances():
    asset, rng = Asset(), random.Random(7)
    asset.room()
    mesh = asset.sphere(asset.diffuse((0.7, 0.3, 0.2)), 16, 10)
    other = asset.sphere(asset.diffuse((0.2, 0.4, 0.7)), 24, 12)

    def rotation():
        q = [rng.gauss(0, 1) for _ in range(4)]
        return [x / math.sqrt(sum(y * y for y in q)) for x in q]

    for i in range(20):
        place = [-2 + i % 5, 0.35 + 0.1 * (i % 3), -2 + i // 5]
        parent = asset.node(translation=place, rotation=rotation(), scale=[0.35, 0.5, 0.2])
        asset.node(parent, mesh=mesh, rotation=rotation(), scale=[1, 0.6, 0.8 if i % 2 else -0.8])
        asset.node(parent, mesh=other, translation=[0.3, 0.9, 0.2], rotation=rotation(), scale=[0.5, 0.9, 0.5])
    return asset


def metal_rough(normals=False):
    asset = Asset()
    asset.room()
    colors = [(200, 60, 40), (230, 230, 230), (60, 120, 190), (240, 200, 90)]
    base = asset.texture(64, 64, lambda x, y: (*colors[x // 16 % 2 + y // 16 % 2 * 2], 255))
    # green: roughness, blue: metalness
    rough = asset.texture(64, 64, lambda x, y: (0, 70 + 50 * (y // 16), 255 if x // 8 % 2 else 0, 255))
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": base}, "metallicRoughnessTexture": {"index": rough}}}
    if normals:
        def texel(x, y):
            # waves of both directions
            n = (0.5 * math.sin(x * math.pi / 8), 0.5 * math.cos(y * math.pi / 8), 1)
            length = math.sqrt(sum(c * c for c in n))
            return (*(round(127.5 + 127.5 * c / length) for c in n), 255)
        material["normalTexture"] = {"index": asset.texture(64, 64, texel)}
    ball = asset.sphere(asset.push("materials", material), 96, 48)
    plain = {"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.6, 0.3, 1], "metallicFactor": 1, "roughnessFactor": 0.4}}
    plastic = {"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.5, 0.3, 1], "metallicFactor": 0, "roughnessFactor": 0.3}}
    asset.node(mesh=ball, translation=[0, 1, 0])
    asset.node(mesh=asset.sphere(asset.push("materials", plain)), translation=[-1.8, 0.7, 0.3], scale=[0.7] * 3)
    asset.node(mesh=asset.sphere(asset.push("materials", plastic)), translation=[1.8, 0.7, 0.3], scale=[0.7] * 3)
    return asset


def mask():
    asset = Asset()
    asset.room()

    def texel(x, y):
        inside = ((x % 32) - 15.5) ** 2 + ((y % 32) - 15.5) ** 2 < 120
        return (80, 160, 60, 255 if inside else 40)
    leaves = asset.push("materials", {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": asset.texture(256, 256, texel)}, "metallicFactor": 0},
        "extensions": {"KHR_materials_specular": {"specularFactor": 0}}, "alphaMode": "MASK", "alphaCutoff": 0.5,
        "doubleSided": True})
    asset.square(leaves, 1.5, translation=[0, 1.8, 0], rotation=[math.sin(0.2), 0, 0, math.cos(0.2)])
    asset.square(leaves, 0.9, translation=[-1.2, 1, 1], rotation=[math.sin(0.7), 0, 0, math.cos(0.7)])
    asset.node(mesh=asset.sphere(asset.diffuse((0.7, 0.7, 0.7))), translation=[0.4, 0.6, 0], scale=[0.6] * 3)
    return asset


SCENES = {"instances": instances, "metal_rough": metal_rough, "normals": lambda: metal_rough(True), "mask": mask}


def cycles(scene, picture, seed):
    """Runs in a process of its own, in which Blender starts from nothing."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(scene))
    s = bpy.context.scene
    s.camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
    s.world = bpy.data.worlds.new("black")
    s.world.use_nodes = True
    s.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
    s.render.engine = "CYCLES"
    c = s.cycles
    c.device, c.samples, c.seed, c.use_adaptive_sampling, c.use_denoising = "CPU", SAMPLES, seed, False, False
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transmission_bounces = c.transparent_max_bounces = 128
    c.sample_clamp_direct = c.sample_clamp_indirect = c.blur_glossy = c.light_sampling_threshold = 0
    c.pixel_filter_type = "BOX"
    s.render.resolution_x, s.render.resolution_y = SIZE
    s.render.threads_mode, s.render.threads = "FIXED", 1
    s.render.image_settings.file_format, s.render.image_settings.color_depth = "OPEN_EXR", "32"
    s.render.filepath = str(picture)
    bpy.ops.render.render(write_still=True)


def read(path):
    import mitsuba as mi
    import numpy as np

    mi.set_variant("scalar_rgb")
    layers = dict(mi.Bitmap(str(path)).split())
    picture = next(b for name, b in layers.items() if name in ("<root>", "", "Combined", "ViewLayer.Combined"))
    return np.array(picture.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)).astype(float)


def blocks(image):
    height, width, _ = image.shape
    rows, columns = height // BLOCK, width // BLOCK
    return image[:rows * BLOCK, :columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3, 4))


def write(rows, command):
    """The table with its circumstances, as the other benchmarks write theirs."""
    root = Path(__file__).resolve().parents[2]

    def said(*words):
        return subprocess.run(words, cwd=root, check=True, capture_output=True, text=True).stdout.strip()

    commit = said("git", "rev-parse", "--short=12", "HEAD")
    changed = " with changes" if said("git", "status", "--porcelain", "--untracked-files=no") else ""
    models = [line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")]
    header = {
        "date": datetime.now(timezone.utc).date().isoformat(),
        "commit": commit + changed,
        "command": command,
        "machine": f"{models[0] if models else 'unknown'}, {len(models)} cores",
        "pictures": f"{SIZE[0]} x {SIZE[1]} pixels, two of {SAMPLES} samples per pixel by each program",
        "blocks": f"{BLOCK} x {BLOCK} pixels, those that are not nearly black",
        "ratios": "croupier over Cycles",
        **{name: version(name) for name in ("bpy", "mitsuba", "numpy")},
    }
    titles = ["scene", "mean", "lowest block", "first quartile", "median", "third quartile", "highest block", "noise", "blocks"]
    lines = ["# Results of `gltf`", "", "Generated, do not edit; explained in [README.md](../README.md).", ""]
    lines += [f"- {key}: {value}" for key, value in header.items()] + ["", "## Blocks", ""]
    lines += ["| " + " | ".join(row) + " |" for row in [titles, ["---"] * len(titles), *rows]]
    path = root / "benches/results/gltf.md"
    path.write_text("\n".join(lines).replace("|  ", "| ").replace("| ---", "|---").replace("--- |", "---|") + "\n")
    print(f"wrote {path.relative_to(root)}")


def main():
    import numpy as np

    program, folder = sys.argv[1], Path(sys.argv[2] if len(sys.argv) > 2 else "target/gltf")
    folder.mkdir(parents=True, exist_ok=True)
    table = []
    for name in sys.argv[3:] or SCENES:
        scene = folder / f"{name}.gltf"
        SCENES[name]().write(scene)
        own, other = [], []
        # two halves of each, whose difference is the noise
        for seed in (1, 2):
            ours, theirs = folder / f"{name}-croupier-{seed}.exr", folder / f"{name}-cycles-{seed}.exr"
            size = f"{SIZE[0]}x{SIZE[1]}"
            subprocess.run([program, "render", scene, "--size", size, "--spp", str(SAMPLES), "--seed", str(seed), "--threads",
                            "1", "--max-depth", "64", "--no-ground", "-o", ours], check=True, stdout=subprocess.DEVNULL)
            subprocess.run([sys.executable, __file__, "--cycles", scene, theirs, str(seed)], check=True,
                           stdout=subprocess.DEVNULL)
            own.append(read(ours))
            other.append(read(theirs))
        a, b = blocks(sum(own) / 2), blocks(sum(other) / 2)
        noise_a, noise_b = (np.abs(blocks(x[0]) - blocks(x[1])) / 2 for x in (own, other))
        lit = b > 0.02 * b.max()
        ratio = a[lit] / b[lit]
        noise = np.sqrt((np.hypot(noise_a[lit] / a[lit], noise_b[lit] / b[lit]) ** 2).mean())
        low, q1, middle, q3, high = np.quantile(ratio, [0, 0.25, 0.5, 0.75, 1])
        print(f"{name:12} mean {a.mean() / b.mean():.4f}  blocks {low:.4f} [{q1:.4f} {middle:.4f} {q3:.4f}] {high:.4f}"
              f"  noise {noise:.4f}  ({lit.sum()} of {lit.size} blocks)", flush=True)
        numbers = [a.mean() / b.mean(), low, q1, middle, q3, high, noise]
        table.append([name, *(f"{x:.4f}" for x in numbers), f"{lit.sum()} of {lit.size}"])
    if not sys.argv[3:]:
        write(table, "python benches/gltf/compare.py target/release/croupier")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--cycles"]:
        cycles(Path(sys.argv[2]).resolve(), Path(sys.argv[3]).resolve(), int(sys.argv[4]))
    else:
        main()
