"""Renders one scene with Mitsuba 3 for the benchmark `beside`, which starts this program and talks to it:

    python benches/mitsuba/render.py SCENE_FOLDER

Requests and answers are JSON, one per line, on standard input and output. First this program says that it is ready:

    {"mitsuba": "3.9.1", "variant": "llvm_ad_rgb", "threads": 1, "size": [256, 256]}

and then it answers every request, until its input ends. `picture` is a file of float32 values (rgb, row by row), valid
until the next request; it lies in a temporary folder of this program.

    {"sampler": "multijitter", "seconds": 20, "seed": 3}
    {"samples": 192, "passes": 4, "core_seconds": 19.8, "not_finite": 0, "picture": "/tmp/.../picture.raw"}

Values of a pass that are not finite count as 0. Where something is wrong the line is {"error": "what"}.

The picture is what a user of Mitsuba gets from the scene's mitsuba.xml with the integrator's own roulette: mitsuba.xml
was made for references, which have none. Path length, size and filter are left as they are. A render is a mean of equal
passes with seeds of their own. They are few and large, about PASSES, because the multijittered sampler stratifies the
samples of one pass. How many need the seconds asked for is measured before the first render with a sampler, which also
compiles the kernels; all renders with this sampler then have the same samples. Counted is the CPU time of this process,
all threads, without loading and compiling.
"""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path

VARIANT = "llvm_ad_rgb"
THREADS = 1
SAMPLERS = ["independent", "multijitter"]
PASSES = 4
# Samples of all pixels in one pass, at most: they are rendered at once, and all have their place in memory.
LARGEST_PASS = 1 << 23
# Seeds of renders are so far apart that no two passes share one.
SEEDS = 1 << 12


class Fault(Exception):
    """What the caller is told."""


def prepared(scene, folder):
    """A copy of the scene with the parts that mitsuba.xml names, and an XML file with a camera for each sampler."""
    tool = scene.parent / "tools" / "convert.py"
    for file in [scene / "mitsuba.xml", tool]:
        if not file.is_file():
            raise Fault(f"there is no file {file}")
    copy = folder / scene.name
    shutil.copytree(scene, copy, ignore=shutil.ignore_patterns("parts", "reference*.exr"))
    # what was copied may be read-only
    copy.chmod(0o755)
    if subprocess.run([sys.executable, tool, "split", copy], stdout=subprocess.DEVNULL).returncode:
        raise Fault(f"{tool} cannot split {scene / 'scene.obj'}")
    root = ET.parse(copy / "mitsuba.xml").getroot()
    integrator, sensor = root.find("integrator"), root.find("sensor")
    if integrator is None or sensor is None:
        raise Fault(f"{scene / 'mitsuba.xml'} has no integrator or no sensor")
    for depth in integrator.findall("integer[@name='rr_depth']"):
        integrator.remove(depth)
    place = list(root).index(sensor)
    root.remove(sensor)
    for sampler in SAMPLERS:
        sensor.find("sampler").set("type", sampler)
        root.insert(place, ET.fromstring(ET.tostring(sensor)))
        place += 1
    file = copy / "beside.xml"
    ET.ElementTree(root).write(file)
    return file


class Renderer:
    """A scene that is loaded."""

    def __init__(self, scene, folder):
        try:
            import drjit as dr
            import mitsuba as mi
            import numpy as np
        except ImportError as e:
            raise Fault(f"{e}: this Python needs the packages mitsuba and numpy") from e
        self.mi, self.np = mi, np
        if VARIANT not in mi.variants():
            raise Fault(f"Mitsuba {mi.__version__} has no variant {VARIANT}")
        mi.set_variant(VARIANT)
        mi.set_log_level(mi.LogLevel.Error)
        try:
            # the library is looked for when something is computed
            dr.eval(dr.arange(mi.Float, 8) + 1)
        except Exception as e:
            raise Fault(f"{e} (LLVM's shared library is a package such as libllvm19; DRJIT_LIBLLVM_PATH tells where "
                        "it is)") from e
        # this thread waits for another one where EXR files are read, so with one thread alone for ever
        dr.set_thread_count(2)
        self.scene = mi.load_file(str(prepared(scene, folder)))
        dr.set_thread_count(THREADS)
        self.size = [int(n) for n in self.scene.sensors()[0].film().size()]
        self.picture = folder / "picture.raw"
        # samples per pixel of a pass and number of passes, by sampler and seconds
        self.plans = {}

    def ready(self):
        return {"mitsuba": self.mi.__version__, "variant": VARIANT, "threads": THREADS, "size": self.size}

    def timed(self, sampler, spp, seed):
        """A pass and its CPU time."""
        start = time.process_time()
        image = self.np.array(self.mi.render(self.scene, sensor=SAMPLERS.index(sampler), spp=spp, seed=seed))
        return image[..., :3], time.process_time() - start

    def plan(self, sampler, seconds):
        """Samples per pixel of a pass and number of passes."""
        key = (sampler, seconds)
        if key not in self.plans:
            largest = max(1, LARGEST_PASS // (self.size[0] * self.size[1]))
            spp = 1
            # passes grow until their time can be measured
            while (took := self.compiled(sampler, spp)) < 0.05 * seconds and spp < largest:
                spp = self.rounded(sampler, 2 * spp)
            spp = self.rounded(sampler, min(max(1, round(spp * seconds / took / PASSES)), largest))
            self.plans[key] = spp, max(1, round(seconds / self.compiled(sampler, spp)))
        return self.plans[key]

    def compiled(self, sampler, spp):
        """CPU time of a pass that is not the first of its kind."""
        self.timed(sampler, spp, 0)
        return self.timed(sampler, spp, 1)[1]

    def rounded(self, sampler, spp):
        """The number of samples that the sampler takes in place of this one: strata fill a rectangle."""
        copy = self.scene.sensors()[SAMPLERS.index(sampler)].sampler().clone()
        copy.set_sample_count(spp)
        return copy.sample_count()

    def render(self, request):
        sampler, seconds, seed = request["sampler"], float(request["seconds"]), int(request["seed"])
        if sampler not in SAMPLERS:
            raise Fault(f"no sampler {sampler!r}; there are: {', '.join(SAMPLERS)}")
        spp, passes = self.plan(sampler, seconds)
        total, used, strange = 0, 0.0, 0
        for i in range(passes):
            image, took = self.timed(sampler, spp, (seed + 1) * SEEDS + i)
            strange += int(image.size - self.np.isfinite(image).sum())
            total = total + self.np.nan_to_num(image.astype(self.np.float64), posinf=0, neginf=0)
            used += took
        (total / passes).astype("<f4").tofile(self.picture)
        return {"samples": spp * passes, "passes": passes, "core_seconds": used, "not_finite": strange,
                "picture": str(self.picture)}


def serve(scene, answer):
    with tempfile.TemporaryDirectory(prefix="croupier-beside-") as folder:
        renderer = Renderer(scene, Path(folder))
        answer(renderer.ready())
        for line in sys.stdin:
            answer(renderer.render(json.loads(line)))


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    # Mitsuba and others also print: answers have a descriptor of their own, all else goes to standard error
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(content):
        print(json.dumps(content), file=answers, flush=True)

    try:
        serve(Path(sys.argv[1]).resolve(), answer)
    except BrokenPipeError:
        sys.exit("nobody reads the answers")
    except Exception as e:
        answer({"error": f"{e}" if isinstance(e, Fault) else f"{type(e).__name__}: {e}"})
        sys.exit(1)


if __name__ == "__main__":
    main()
