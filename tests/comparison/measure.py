"""Measures this engine beside VTK and VolPack and writes a Markdown table; started by `tests/compare`."""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
import vtk
from scenes import LIGHT, MATERIAL, SIZE, VOLUMES, scenes
from vtk_frames import read

HERE = Path(__file__).parent
BEGIN, END = "<!-- tests/compare begins -->", "<!-- tests/compare ends -->"
# Programs take turns, so that all see the same disturbances: turns, and frames of each program in a turn.
TURNS, FRAMES = 3, {"vtk": 7, "volpack": 15, "ours": 21}
# Load average above which times of two threads say little.
BUSY = 0.5
# VolPack keeps opacities in 8 bits; smaller ones vanish.
LEAST_OPACITY = 0.5 / 255


def unit(vector):
    return numpy.asarray(vector, float) / numpy.linalg.norm(vector)


def run(command):
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if result.returncode:
        sys.exit(f"compare: {' '.join(map(str, command))}\n{result.stderr}")
    return result.stdout


def listed(values):
    return ",".join(f"{value:.9g}" for value in values)


class Subject:
    """A volume, how it is seen, and files that the programs read."""

    def __init__(self, volume, data, volumepro, folder):
        self.volume, self.folder = volume, folder
        self.file, self.name = Path(data) / f"{volume.name}.nrrd", volume.name
        if not self.file.is_file():
            print(f"compare: {self.file} is not there; phantom {volume.phantom} stands in for it", file=sys.stderr)
            self.file, self.name = folder / f"{volume.phantom}.nrrd", f"phantom {volume.phantom}"
            run([volumepro, "phantom", volume.phantom, "--size", 256, "-o", self.file])
        voxels, spacing = read(self.file)
        self.size, self.spacing = voxels.shape, numpy.array(spacing)
        self.voxels = folder / f"{volume.name}.raw"
        voxels.astype("<u2").ravel(order="F").tofile(self.voxels)
        self.eye = unit(volume.eye)
        self.focal = (numpy.array(self.size) - 1) / 2 * self.spacing
        self.position = self.focal + 1000 * self.eye
        self.right = unit(numpy.cross(volume.up, self.eye))
        self.up = numpy.cross(self.eye, self.right)

    def heading(self):
        return f"{self.name}, {'×'.join(map(str, self.size))}"

    def world(self, camera):
        """A direction of camera space in the world."""
        return unit(camera[0] * self.right + camera[1] * self.up + camera[2] * self.eye)


class Vtk:
    def __init__(self, subject, scene, folder):
        self.command = [sys.executable, HERE / "vtk_frames.py", subject.file, folder / "scene.json", FRAMES["vtk"]]
        self.command.append(folder / "vtk.png")
        description = {
            "rows": scene.rows,
            "shaded": scene.shaded,
            "material": MATERIAL,
            "light": LIGHT,
            "size": SIZE,
            "scale": subject.volume.scale,
            "position": list(subject.position),
            "focal": list(subject.focal),
            "up": subject.volume.up,
        }
        (folder / "scene.json").write_text(json.dumps(description))

    def measure(self):
        return json.loads(run(self.command))["ms"]


class Ours:
    def __init__(self, subject, scene, folder, volumepro, threads):
        self.command = [volumepro, "render", subject.file, "-o", folder / f"ours-{threads}.png"]
        self.command += ["--size", f"{SIZE}x{SIZE}", "--parallel-scale", subject.volume.scale]
        self.command += ["--position", listed(subject.position), "--focal", listed(subject.focal)]
        self.command += ["--up", listed(subject.volume.up), "--threads", threads]
        self.command += ["--frames", FRAMES["ours"], "--stats", "json"]
        if scene.is_projection:
            self.command += ["--blend", "mip"]
            return
        table = folder / "transfer.csv"
        rows = [",".join(map(str, row)) for row in scene.rows]
        table.write_text("\n".join(["value,red,green,blue,opacity", *rows]) + "\n")
        self.command += ["--transfer", table, "--shading", "on" if scene.shaded else "off"]
        if scene.shaded:
            self.command += ["--material", listed(MATERIAL), "--light", listed(LIGHT)]

    def measure(self):
        """Engine and warp; the latter alone is kept, too."""
        report = json.loads(run(self.command))
        self.warp = report["warp_ms"]
        return [engine + warp for engine, warp in zip(report["render_ms_all"], report["warp_ms_all"])]


class Volpack:
    def __init__(self, subject, scene, folder, program):
        self.picture, self.prepare = folder / "volpack.pnm", []
        self.command = [program, folder / "scene.txt", subject.voxels, FRAMES["volpack"], self.picture]
        table = numpy.array(scene.rows)
        values = numpy.arange(4096)
        red, green, blue, opacity = (numpy.interp(values, table[:, 0], table[:, column]) for column in range(1, 5))
        colors = numpy.stack([red, green, blue], axis=1)
        channels = 1 if (red == green).all() and (green == blue).all() else 3
        # The volume's longest edge is of unit length, its middle the origin; VolPack looks along +z.
        view = numpy.identity(4)
        rotation = numpy.stack([subject.right, subject.up, -subject.eye])
        view[:3, :3] = rotation * (max(subject.size) * subject.spacing)
        numbers = [*subject.size, *subject.spacing, *view.ravel(), subject.volume.scale, SIZE, int(scene.shaded)]
        numbers += [channels, LEAST_OPACITY, *corrected(opacity, subject)]
        if scene.shaded:
            numbers += [*colors[0, :channels], *MATERIAL, *subject.world([-part for part in LIGHT]), *subject.eye]
        else:
            numbers += [*colors[:, :channels].ravel()]
        (folder / "scene.txt").write_text("\n".join(f"{number:.9g}" for number in numbers))

    def measure(self):
        report = json.loads(run(self.command))
        self.prepare.append(report["classify_ms"])
        return report["ms"]


def corrected(opacity, subject):
    """VolPack corrects opacities for the distance between samples in voxels; what lacks is that in millimetres."""
    along = numpy.abs(subject.eye / subject.spacing)
    distance = 1 / along.max()
    in_voxels = numpy.linalg.norm(along) / along.max()
    return 1 - (1 - opacity) ** (distance / in_voxels / subject.spacing.min())


def as_png(picture):
    reader, writer = vtk.vtkPNMReader(), vtk.vtkPNGWriter()
    reader.SetFileName(str(picture))
    writer.SetInputConnection(reader.GetOutputPort())
    writer.SetFileName(str(picture.with_suffix(".png")))
    writer.Write()


def compare(subject, scene, arguments):
    """Measures a scene with all programs: best and median of each in milliseconds, and the rest of its row."""
    folder = subject.folder / f"{subject.volume.name}-{scene.name.replace(' ', '-')}"
    folder.mkdir()
    programs = {"VTK": Vtk(subject, scene, folder)}
    for threads in (2, 1):
        programs[f"ours, {threads}"] = Ours(subject, scene, folder, arguments.volumepro, threads)
    if arguments.volpack and not scene.is_projection:
        programs["VolPack"] = Volpack(subject, scene, folder, arguments.volpack)
    times = {name: [] for name in programs}
    for _ in range(TURNS):
        for name, program in programs.items():
            times[name] += program.measure()
    if "VolPack" in programs:
        as_png(programs["VolPack"].picture)
    row = {name: (min(all), statistics.median(all)) for name, all in times.items()}
    row["warp"] = programs["ours, 1"].warp
    row["prepare"] = min(programs["VolPack"].prepare) if "VolPack" in programs else None
    return row, folder


def shown(value):
    return f"{value:.0f}" if value >= 99.5 else f"{value:.1f}" if value >= 9.95 else f"{value:.2f}"


def pair(times):
    return f"{shown(times[0])} ({shown(times[1])})" if times else "–"


def ratio(slow, fast):
    return f"{shown(slow[0] / fast[0])}×" if slow else "–"


HEAD = (
    "| scene | VTK | ours, 2 threads | faster | VolPack | ours, 1 thread | faster | its warp | VolPack classifies |",
    "|---|---|---|---|---|---|---|---|---|",
)


def line(scene, row):
    volpack, one, two = row.get("VolPack"), row["ours, 1"], row["ours, 2"]
    cells = [scene.name, pair(row["VTK"]), pair(two), ratio(row["VTK"], two), pair(volpack), pair(one)]
    cells += [ratio(volpack, one), shown(row["warp"]), shown(row["prepare"]) if row["prepare"] else "–"]
    return f"| {' | '.join(cells)} |"


def processor():
    names = [row.split(":", 1)[1].strip() for row in open("/proc/cpuinfo") if row.startswith("model name")]
    return f"{names[0]}, {len(names)} cores" if names else "unknown processor"


def report(sections, arguments):
    version = vtk.vtkVersion().GetVTKVersion()
    vtk_frames, volpack, ours = (TURNS * FRAMES[name] for name in ("vtk", "volpack", "ours"))
    text = [f"{processor()}; VTK {version}. Milliseconds, best of {vtk_frames} frames of VTK, {volpack} of VolPack and"]
    text.append(f"{ours} of ours; medians in brackets.")
    if not arguments.volpack:
        text.append("VolPack was not to be had.")
    for heading, rows in sections:
        text += ["", f"**{heading}**", "", *HEAD, *rows]
    return "\n".join(text) + "\n"


def rewrite(path, text):
    """Puts the text between the markers of a file."""
    old = path.read_text()
    if old.count(BEGIN) != 1 or old.count(END) != 1:
        sys.exit(f"compare: {path}: the lines '{BEGIN}' and '{END}' are wanted once each")
    before, after = old.split(BEGIN)[0], old.split(END)[1]
    path.write_text(f"{before}{BEGIN}\n{text}{END}{after}")


def sheet(path, rows, arguments):
    """All programs' pictures of a volume, a scene in a row."""
    lines = []
    for scene, folder in rows:
        lines.append(f"= {scene.name}")
        for name, file in (("VTK", "vtk"), ("VolPack", "volpack"), ("ours", "ours-2")):
            picture = folder / f"{file}.png"
            if picture.is_file():
                lines.append(f"{picture} {name}")
    subprocess.run([arguments.sheet, path], input="\n".join(lines) + "\n", text=True, check=True)


def main():
    parser = argparse.ArgumentParser(prog="tests/compare")
    parser.add_argument("--markdown", type=Path, help="file whose table is rewritten")
    parser.add_argument("--pictures", type=Path, help="folder for a sheet of pictures of each volume")
    parser.add_argument("--volume", action="append", choices=[volume.name for volume in VOLUMES], help="only this one")
    for program in ("volumepro", "sheet", "volpack", "data"):
        parser.add_argument(f"--{program}", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
    load = os.getloadavg()[0]
    if load > BUSY:
        print(f"compare: this machine is busy (load average {load:.1f}): times will be too long", file=sys.stderr)
    sections = []
    with tempfile.TemporaryDirectory() as folder:
        for volume in VOLUMES:
            if arguments.volume and volume.name not in arguments.volume:
                continue
            subject = Subject(volume, arguments.data, arguments.volumepro, Path(folder))
            print(f"\n{subject.heading()}\n\n" + "\n".join(HEAD), flush=True)
            rows, pictures = [], []
            for scene in scenes(volume):
                row, place = compare(subject, scene, arguments)
                rows.append(line(scene, row))
                pictures.append((scene, place))
                print(rows[-1], flush=True)
            sections.append((subject.heading(), rows))
            if arguments.pictures:
                sheet(arguments.pictures / f"{volume.name}.png", pictures, arguments)
    if arguments.markdown:
        rewrite(arguments.markdown, report(sections, arguments))


main()
