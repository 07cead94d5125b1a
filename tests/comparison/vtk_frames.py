"""Draws frames with VTK's fixed-point ray caster: `vtk_frames.py VOLUME SCENE FRAMES PICTURE.png`.

VOLUME is an NRRD file and SCENE a JSON file of `measure.py`. Prints a JSON object with the time of each frame.
"""

import json
import sys

import nrrd
import numpy
import vtk
from vtk.util.numpy_support import numpy_to_vtk

THREADS = 2
# Frames are seen from two sides in turn, this many degrees apart, so that none can be kept.
TURN = 0.1


def read(path):
    """Voxels in VTK's order and spacing in millimetres."""
    voxels, header = nrrd.read(path)
    kind = numpy.uint8 if voxels.dtype.itemsize == 1 else numpy.uint16
    spacing = header.get("spacings")
    if spacing is None:
        spacing = numpy.linalg.norm(header["space directions"], axis=1)
    return voxels.astype(kind), [float(step) for step in spacing]


def image(path):
    voxels, spacing = read(path)
    data = vtk.vtkImageData()
    data.SetDimensions(voxels.shape)
    data.SetSpacing(spacing)
    data.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel(order="F"), deep=True))
    return data


def appearance(scene, data):
    ramp, colors = vtk.vtkPiecewiseFunction(), vtk.vtkColorTransferFunction()
    if scene["rows"]:
        for value, red, green, blue, opacity in scene["rows"]:
            ramp.AddPoint(value, opacity)
            colors.AddRGBPoint(value, red, green, blue)
    else:
        low, high = data.GetScalarRange()
        ramp.AddPoint(low, 1)
        colors.AddRGBPoint(low, 0, 0, 0)
        colors.AddRGBPoint(high, 1, 1, 1)
    look = vtk.vtkVolumeProperty()
    look.SetScalarOpacity(ramp)
    look.SetColor(colors)
    look.SetInterpolationTypeToLinear()
    look.SetScalarOpacityUnitDistance(min(data.GetSpacing()))
    emissive, diffuse, specular, exponent = scene["material"]
    look.SetShade(scene["shaded"])
    look.SetAmbient(emissive)
    look.SetDiffuse(diffuse)
    look.SetSpecular(specular)
    look.SetSpecularPower(exponent)
    return look


def ray_caster(data, scene):
    mapper = vtk.vtkFixedPointVolumeRayCastMapper()
    mapper.SetInputData(data)
    mapper.SetNumberOfThreads(THREADS)
    mapper.SetSampleDistance(min(data.GetSpacing()))
    mapper.SetInteractiveSampleDistance(min(data.GetSpacing()))
    mapper.SetImageSampleDistance(1)
    mapper.AutoAdjustSampleDistancesOff()
    mapper.LockSampleDistanceToInputSpacingOff()
    if not scene["rows"]:
        mapper.SetBlendModeToMaximumIntensity()
    return mapper


def window(scene, volume):
    renderer = vtk.vtkRenderer()
    renderer.TwoSidedLightingOff()
    renderer.AutomaticLightCreationOff()
    light = vtk.vtkLight()
    light.SetLightTypeToCameraLight()
    light.SetPosition([-component for component in scene["light"]])
    light.SetFocalPoint(0, 0, 0)
    light.SetAmbientColor(1, 1, 1)
    renderer.AddLight(light)
    renderer.AddVolume(volume)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(scene["scale"])
    camera.SetPosition(scene["position"])
    camera.SetFocalPoint(scene["focal"])
    camera.SetViewUp(scene["up"])
    renderer.ResetCameraClippingRange()
    view = vtk.vtkRenderWindow()
    view.SetOffScreenRendering(True)
    view.SetMultiSamples(0)
    view.SetSize(scene["size"], scene["size"])
    view.AddRenderer(renderer)
    return view, camera


def write(view, path):
    picture = vtk.vtkWindowToImageFilter()
    picture.SetInput(view)
    picture.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetInputConnection(picture.GetOutputPort())
    writer.SetFileName(path)
    writer.Write()


def main(path, scene, frames, picture):
    with open(scene) as file:
        scene = json.load(file)
    data = image(path)
    mapper = ray_caster(data, scene)
    volume = vtk.vtkVolume()
    volume.SetMapper(mapper)
    volume.SetProperty(appearance(scene, data))
    view, camera = window(scene, volume)
    # The first frame is not counted: it measures gradients.
    view.Render()
    write(view, picture)
    drawn, times = [], []
    mapper.AddObserver("VolumeMapperRenderEndEvent", lambda *_: drawn.append(True))
    for frame in range(int(frames)):
        camera.Azimuth(TURN if frame % 2 == 0 else -TURN)
        view.Render()
        # The ray caster's own time, without what OpenGL takes to show the picture.
        times.append(mapper.GetTimeToDraw() * 1e3)
    if len(drawn) < len(times):
        sys.exit("frames were not drawn anew")
    print(json.dumps({"ms": times}))


if __name__ == "__main__":
    main(*sys.argv[1:])
