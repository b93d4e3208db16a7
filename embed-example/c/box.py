#!/usr/bin/env python3
"""Renders a baked scene with croupier through ctypes: nothing but Python and the shared library.

    LD_LIBRARY_PATH=... python3 box.py box.crp box.ppm

The library is found by its name, so that the loader takes the build for this processor (a path would name one of them).
The last line that it prints is the hash of embed-example/hashes.txt, A.
"""

import ctypes
import sys
from ctypes import byref, c_char, c_float, c_size_t, c_uint32, c_uint64, c_void_p

ALIGN, SCENE_BYTES = 64, 2048
SETTINGS = {
    "rrs": "ears", "ring": "64", "ledger": "256", "cache-bytes": "65536", "split-budget": "64",
    "pixel-estimator": "blocks",
}


class Sizes(ctypes.Structure):
    """croupier_sizes"""

    _fields_ = [
        ("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("shards", c_uint32),
        ("session", c_uint64), ("shard", c_uint64), ("stack", c_uint64),
    ]


class Croupier:
    """The library: `lib.call("shard_step", ...)` is croupier_shard_step(..., message), and raises what it says."""

    def __init__(self, name="libcroupier.so.0"):
        self.lib = ctypes.CDLL(name)
        self.lib.croupier_instruction_set.restype = ctypes.c_char_p
        if self.lib.croupier_abi_version() < 1:
            raise RuntimeError("the library is too old")
        self.call("check_processor")

    def call(self, name, *arguments):
        """Calls a function that returns a status."""
        message = (c_char * 256)()
        if getattr(self.lib, "croupier_" + name)(*arguments, message) != 0:
            raise RuntimeError(message.value.decode())


def block(size):
    """Memory that starts at a multiple of ALIGN: the buffer, which must be kept, and its address."""
    buffer = (c_char * (size + ALIGN))()
    return buffer, c_void_p(-(-ctypes.addressof(buffer) // ALIGN) * ALIGN)


def render(lib, blob):
    """Renders 2 + 2 + 4 samples per pixel: width, height and the floats of the picture."""
    keep, where = block(len(blob))
    ctypes.memmove(where, blob, len(blob))
    scene_block, at = block(SCENE_BYTES)
    scene, session, shard = c_void_p(), c_void_p(), c_void_p()
    lib.call("scene_init", at, c_size_t(SCENE_BYTES), where, c_size_t(len(blob)), byref(scene))
    settings, plan, sizes = (c_uint64 * 64)(), (c_uint64 * 128)(), Sizes(struct_size=ctypes.sizeof(Sizes))
    lib.call("settings_init", settings, scene)
    for name, text in SETTINGS.items():
        lib.call("settings_set", settings, name.encode(), text.encode())
    lib.call("plan_init", plan, settings)
    lib.call("plan_sizes", plan, byref(sizes))
    session_block, at = block(sizes.session)
    lib.call("session_init", at, c_size_t(sizes.session), plan, scene, byref(session))
    shard_block, at = block(sizes.shard)
    lib.call("shard_init", at, c_size_t(sizes.shard), plan, c_uint32(0), byref(shard))
    for samples in (2, 2, 4):
        lib.call("session_begin_iteration", session, c_uint32(samples))
        more = c_uint32(1)
        while more.value:
            lib.call("shard_step", shard, session, c_uint64(100000), byref(more))
        more = c_uint32(1)
        while more.value:
            all_shards = (c_void_p * 1)(shard)
            budget = c_uint64(1000000)
            lib.call("session_finish_iteration", session, all_shards, c_size_t(1), budget, byref(more))
    rgb = (c_float * (3 * sizes.width * sizes.height))()
    lib.call("session_rgb", session, rgb, c_size_t(len(rgb)))
    for name, handle in (("shard", shard), ("session", session), ("scene", scene)):
        lib.call(name + "_destroy", handle)
    del keep, scene_block, session_block, shard_block  # until here the library has used them
    return sizes.width, sizes.height, rgb


def fnv(data):
    """64-bit FNV-1a."""
    value = 0xCBF29CE484222325
    for byte in data:
        value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return value


def main():
    """Renders a file."""
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} SCENE.crp PICTURE.ppm")
    lib = Croupier()
    print("croupier,", lib.lib.croupier_instruction_set().decode(), file=sys.stderr)
    with open(sys.argv[1], "rb") as file:
        width, height, rgb = render(lib, file.read())
    with open(sys.argv[2], "wb") as file:
        file.write(b"P6\n%d %d\n255\n" % (width, height))
        file.write(bytes(int(min(max(x, 0.0), 1.0) ** 0.5 * 255.0) for x in rgb))
    print(f"{fnv(bytes(rgb)):016x}")


if __name__ == "__main__":
    main()
