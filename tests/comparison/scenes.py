"""What is drawn: real volumes, and of each the same five scenes with its own values."""

from dataclasses import dataclass

# Emissive, diffuse and specular coefficients and exponent; where light travels in camera space.
MATERIAL = (0.15, 0.75, 0.3, 16.0)
LIGHT = (-0.45, -0.55, -1.0)
# Pixels of the picture's sides.
SIZE = 256


@dataclass
class Volume:
    name: str
    phantom: str  # stands in for a file that is not there
    eye: tuple  # towards the viewer, in the world
    up: tuple
    scale: float  # half the picture's height in millimetres
    tissue: tuple  # values where tissue begins, where it is thin and where it is thick
    surface: tuple  # values where the opaque surface begins and where it is there


VOLUMES = (
    Volume("engine", "engine-block", (-0.5, 0.5, -0.7), (0, 1, 0), 150, (60, 120, 255), (140, 180)),
    Volume("ct_head", "ellipsoids", (-0.45, -0.88, -0.16), (0, 0, -1), 130, (500, 1000, 3000), (1150, 1350)),
    Volume("mri_head", "ellipsoids", (0.8, -0.2, 0.55), (0, -1, 0), 140, (25, 80, 240), (35, 60)),
    Volume("bonsai", "sphere-flake", (0.5, 0.4, 0.77), (0, 1, 0), 150, (35, 70, 255), (45, 75)),
)


@dataclass
class Scene:
    name: str
    shaded: bool
    rows: tuple = ()  # value, red, green, blue, opacity per voxel; none: maximum intensity
    # A shaded scene has one colour, so that VolPack needs one material.

    @property
    def is_projection(self):
        return not self.rows


def scenes(volume):
    begin, thin, thick = volume.tissue
    skin, white = (1.0, 0.82, 0.65), (1.0, 1.0, 1.0)
    opacities = ((0, 0.0), (begin, 0.0), (thin, 0.05), (thick, 0.3))
    tissue = tuple((value, *skin, opacity) for value, opacity in opacities)
    colors = (skin, (0.6, 0.15, 0.1), (0.95, 0.7, 0.45), white)
    unshaded = tuple((value, *color, opacity) for (value, opacity), color in zip(opacities, colors))
    first, there = volume.surface
    return (
        Scene("shaded tissue", True, tissue),
        Scene("unshaded tissue", False, unshaded),
        Scene("maximum intensity", False),
        Scene("opaque surface", True, ((0, *white, 0.0), (first, *white, 0.0), (there, *white, 1.0))),
        Scene("nothing to skip", True, ((0, *white, 0.004), (begin, *white, 0.004), (thick, *white, 0.06))),
    )
